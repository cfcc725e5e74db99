"""Reports by chainage: what road authorities buy, a row per interval and side of a route."""

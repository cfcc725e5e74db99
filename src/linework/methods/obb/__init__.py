"""The obb method: lane markings and road boundaries by oriented bounding boxes, tracked through the points."""

"""What each laser point lies on: road, footway, verge, marking, kerb, rail, barrier, wire, pole, vegetation or other."""

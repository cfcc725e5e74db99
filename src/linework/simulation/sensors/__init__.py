"""What records it: scanners, cameras, logs."""

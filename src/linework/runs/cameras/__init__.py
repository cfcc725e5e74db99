"""What runs find out about the cameras of a survey."""

"""Surveys: a folder, its survey.toml, a KITTI drive, or point files."""

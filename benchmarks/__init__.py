"""What is timed, each as a ratio to something that runs in the same minute on the same machine.

`python -m benchmarks` runs all, `python -m benchmarks radon` one. Nothing timed is asserted in tests.

Two are no timings: `same_lines` compares the lines of two revisions, `files_entered` counts the files that a survey
enters.
"""

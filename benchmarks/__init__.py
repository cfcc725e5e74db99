"""What is timed, each as a ratio to something that runs in the same minute on the same machine.

`python -m benchmarks` runs all, `python -m benchmarks radon` one. Nothing timed is asserted in tests.
"""

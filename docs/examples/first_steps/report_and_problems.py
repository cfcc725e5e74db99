"""
What was left out
=================

A run over many files should not stop for a damaged one, and should not hide it either. Every result has a report,
and by default nothing is lost in silence.
"""

import warnings

import matplotlib.pyplot as plt

import linework

# %%
# Two files, one of them cut off in the middle, as after a failed copy.

survey = linework.simulate("drive", road="bends", seed=7, length_m=50.0, points_per_m=1000, images=False)
good = survey.point_files[0]
damaged = good.with_name("damaged.laz")
damaged.write_bytes(good.read_bytes()[: good.stat().st_size // 2])

# %%
# The default: an error that says what is wrong, and where.

try:
    linework.extract("drive/points/*.laz", kinds="guardrail")
except linework.LineworkError as error:
    print(error)

# %%
# With ``on_problem="warn"`` the other files are used, a warning is given, and the report lists what was left out.

with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    lines = linework.extract("drive/points/*.laz", kinds="guardrail", on_problem="warn")
for warning in caught:
    print(warning.message)

# %%
# The report goes with the lines.

report = lines.report
report

# %%
# Its parts are plain values.

assert report is not None
for left_out in report.left_out:
    print(left_out)
print("stages:", ", ".join(report.timings_s))

# %%
# The lines of the files that could be read are all there.

fig, ax = plt.subplots(figsize=(9, 4), layout="constrained")
lines.plot(ax)

# %%
# Mistakes in a call are answered in the words of the call.

try:
    linework.extract("drive", kinds="guardrails")
except linework.LineworkError as error:
    print(error)
plt.show()

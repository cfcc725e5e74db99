"""A survey folder that is written over."""

from linework.files.survey.open import open_survey
from linework.simulation.folder import write_survey_folder
from linework.simulation.simulate import simulate_survey


def test_a_pass_of_an_older_survey_is_not_taken_for_ours(tmp_path):
    two = one = None
    for seed in range(30):
        survey = simulate_survey("straight", seed, 40.0, points_per_m=300.0)
        if len(survey.scenario.passes) == 2:
            two = two or survey
        else:
            one = one or survey
        if one and two:
            break
    write_survey_folder(two, tmp_path / "s")
    assert [p.name for p in open_survey([tmp_path / "s"]).point_files] == ["pass_1.laz", "pass_2.laz"]
    write_survey_folder(one, tmp_path / "s", overwrite=True)
    assert [p.name for p in open_survey([tmp_path / "s"]).point_files] == ["pass_1.laz"]

"""The release recipe: GitHub could read it, and each wheel that it builds is tried before anything is published."""

from __future__ import annotations

from pathlib import Path

import yaml

RECIPE = Path(__file__).resolve().parents[2] / ".github/workflows/release.yml"


def test_each_wheel_is_tried_and_all_of_it_precedes_publishing():
    jobs = yaml.safe_load(RECIPE.read_text())["jobs"]
    built, tried = ({row["name"] for row in jobs[job]["strategy"]["matrix"]["include"]} for job in ("wheels", "try"))
    assert built == tried and len(built) == 5
    for name, job in jobs.items():
        needs = [job["needs"]] if isinstance(job.get("needs"), str) else job.get("needs", [])
        assert set(needs) <= set(jobs), name
        assert all(("uses" in step) != ("run" in step) for step in job["steps"]), name
    assert {"wheels", "sdist", "try"} <= set(jobs["publish"]["needs"])
    assert jobs["publish"]["permissions"] == {"id-token": "write"}

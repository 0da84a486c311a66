"""A picture of the report: what the paper says, what is drawn, and the drawing itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from analysis import RecordError
from recognition.estimation.errors import RecognitionError
from report.figures import style as figures
from report.study import Study


@dataclass(frozen=True)
class Plan:
    """draw(study) returns a Figure, or (Figure, words to add to the caption).

    said: what the paper says of its figure; caption: what ours shows.
    """

    key: str
    title: str
    said: str
    caption: str
    draw: Callable[[Study], object]
    pixels: bool = False


@dataclass(frozen=True)
class Picture:
    """uri is empty where the runs do not hold what the picture needs; the caption then says why."""

    key: str
    title: str
    said: str
    caption: str
    uri: str


def realise(plan: Plan, study: Study) -> Picture:
    try:
        drawn = plan.draw(study)
    except (RecordError, RecognitionError) as reason:
        return Picture(plan.key, plan.title, plan.said, f"Not drawn: {reason}", "")
    figure, words = drawn if isinstance(drawn, tuple) else (drawn, "")
    caption = f"{plan.caption} {words}".strip()
    return Picture(
        plan.key, plan.title, plan.said, caption, figures.to_uri(figure, plan.key, pixels=plan.pixels)
    )

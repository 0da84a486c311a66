"""The recognition methods by name: what the report needs of recognition's registry."""

from __future__ import annotations

from recognition.methods import EVALUATED, METHODS
from recognition.paper.pipeline import as_published, modified

#: The three methods of the paper.
FUSION_Q = "fusion_q"
FUSION_AS_PUBLISHED = "energy_fusion_as_published"
FUSION_MODIFIED = "energy_fusion_modified"

#: The paper's energy fusion in a few words, for the statement that compares it with Q.
FUSION_WORDS = {FUSION_AS_PUBLISHED: "as published", FUSION_MODIFIED: "modified"}

#: The paper's recognition strategy, unfitted.
STRATEGY_AS_PUBLISHED = as_published
MODIFIED_STRATEGY = modified

#: Methods of a model, and with further ones of the evaluation: {name: as a reader sees it}, in order.
MODEL_METHODS = {name: entry.title for name, entry in METHODS.items()}
EVALUATED_METHODS = {name: entry.title for name, entry in EVALUATED.items()}

#: Methods in the figure of the evaluation: the paper's, the baseline, and those that give an interval (best first).
PAPER_METHODS = (FUSION_Q, FUSION_AS_PUBLISHED, FUSION_MODIFIED)
BASELINE = "rms_line"
METHODS_WITH_INTERVAL = tuple(name for name, entry in EVALUATED.items() if entry.gives_interval and name != BASELINE)

#: Methods of a model that give an interval; the first that answers opens the report.
MODEL_METHODS_WITH_INTERVAL = tuple(name for name in METHODS_WITH_INTERVAL if name in METHODS)

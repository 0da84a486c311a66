"""The recognition methods by name: what the report needs of recognition's registry."""

from __future__ import annotations

from recognition.methods import METHODS

#: The three methods of the paper.
FUSION_Q = "fusion_q"
FUSION_AS_PUBLISHED = "energy_fusion_as_published"
FUSION_MODIFIED = "energy_fusion_modified"

#: The paper's energy fusion in a few words, for the statement that compares it with Q.
FUSION_WORDS = {FUSION_AS_PUBLISHED: "as published", FUSION_MODIFIED: "modified"}

#: {name: as a reader sees it}, in order.
MODEL_METHODS = {name: entry.title for name, entry in METHODS.items()}

#: Methods of a model that give an interval; the first that answers opens the report.
MODEL_METHODS_WITH_INTERVAL = tuple(name for name, entry in METHODS.items() if entry.gives_interval)

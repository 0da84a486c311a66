"""The recognition methods by name: what the report needs of recognition's registry."""

from __future__ import annotations

from recognition.methods import CALIBRATED, EVALUATED_NAMES, METHOD_NAMES, mended, printed

#: The three methods of the paper.
FUSION_Q = "fusion_q"
FUSION_AS_PUBLISHED = "energy_fusion_printed"
FUSION_MODIFIED = "energy_fusion_mended"

#: The paper's energy fusion in a few words, for the statement that compares it with Q.
FUSION_WORDS = {FUSION_AS_PUBLISHED: "printed", FUSION_MODIFIED: "mended"}

#: Its recognition strategy, unfitted.
STRATEGY_AS_PUBLISHED = printed
MODIFIED_STRATEGY = mended

#: Methods of a model, and with further ones of the evaluation: {name: as a reader sees it}, in order.
MODEL_METHODS = METHOD_NAMES
EVALUATED_METHODS = EVALUATED_NAMES

#: Methods in the figure of the evaluation: the paper's, the baseline, and those that give an interval (best first).
PAPER_METHODS = (FUSION_Q, FUSION_AS_PUBLISHED, FUSION_MODIFIED)
BASELINE = "rms_line"
METHODS_WITH_INTERVAL = (*CALIBRATED, "stones_fast")

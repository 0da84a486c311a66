"""All statements of the paper, in its order, those of a chapter together; the last are of the recognised ratios."""

from report.breakage.claims import BREAKAGE_STATEMENTS
from report.recognition.claims import RECOGNITION_STATEMENTS
from report.response.claims import RESPONSE_STATEMENTS
from report.signals.claims import SIGNAL_STATEMENTS
from report.theory.claims import THEORY_STATEMENTS

STATEMENTS = [THEORY_STATEMENTS, BREAKAGE_STATEMENTS, RESPONSE_STATEMENTS, SIGNAL_STATEMENTS, RECOGNITION_STATEMENTS]

"""The proof: machines with concealed effects, explained blind, and the answers scored."""

from .counting import Rate as Rate, summary as summary
from .drawing import draw as draw
from .planning import Case as Case, plan as plan
from .results import results as results
from .running import conclude as conclude, run as run
from .scoring import Score as Score, scores as scores
from .writing import report as report, short as short

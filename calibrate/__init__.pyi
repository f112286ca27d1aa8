from .data import Experiment as Experiment
from .fit import Fit as Fit
from .fit import LogNormal as LogNormal
from .fit import fit as fit
from .identify import Identification as Identification
from .identify import identify as identify
from .predict import FORWARD_MODELS as FORWARD_MODELS
from .residuals import Problem as Problem

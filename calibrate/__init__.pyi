from .experiment.experiment import Experiment as Experiment
from .inference.identify import Identification as Identification
from .inference.identify import identify as identify
from .least_squares.fit import Fit as Fit
from .least_squares.fit import fit as fit
from .least_squares.priors import LogNormal as LogNormal
from .models.forward_models import FORWARD_MODELS as FORWARD_MODELS
from .problem.problem import Problem as Problem

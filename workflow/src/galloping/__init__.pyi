"""The public names: type checkers see them here, and `__init__.py` imports each at first use."""

from galloping.configuration.yaml_file import ConfigurationError
from galloping.estimator import MaximumLikelihood, NotFittedError
from galloping.field.assess import assess
from galloping.field.assessment import Assessment
from galloping.field.dynamics import Dynamics, Value
from galloping.field.forecast import Forecast
from galloping.field.summary import Summary, dynamics, forecast, summarise
from galloping.identification.likelihood.maximum_likelihood import maximum_likelihood
from galloping.identification.likelihood.weak_gls import weak_gls
from galloping.identification.model import IdentifiedModel
from galloping.identification.prior_knowledge import Coefficient, Prior
from galloping.passes import progress
from galloping.plotting import plot_fit, plot_forecast, plot_phase
from galloping.polynomial import PolynomialModel
from galloping.polynomial import library as polynomial_library
from galloping.recording import Input, Recording
from galloping.simulation import Simulator, Trajectory
from galloping.stages import cramer_rao_bound, derive, measure, simulate
from galloping.terms import parse as library
from galloping.terms import parse_model

__version__: str
__all__ = [
    "Assessment",
    "Coefficient",
    "ConfigurationError",
    "Dynamics",
    "Forecast",
    "IdentifiedModel",
    "Input",
    "MaximumLikelihood",
    "NotFittedError",
    "PolynomialModel",
    "Prior",
    "Recording",
    "Simulator",
    "Summary",
    "Trajectory",
    "Value",
    "__version__",
    "assess",
    "cramer_rao_bound",
    "derive",
    "dynamics",
    "forecast",
    "library",
    "maximum_likelihood",
    "measure",
    "parse_model",
    "plot_fit",
    "plot_forecast",
    "plot_phase",
    "polynomial_library",
    "progress",
    "simulate",
    "summarise",
    "weak_gls",
]

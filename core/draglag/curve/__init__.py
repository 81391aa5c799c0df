"""Latency against speed: Eq. 5 and its rivals."""

from draglag.curve.fit import CurveFit, fit_best, fit_form
from draglag.curve.forms import FORMS, Form
from draglag.curve.points import CurvePoints

__all__ = ["FORMS", "CurveFit", "CurvePoints", "Form", "fit_best", "fit_form"]

"""The settings of each method: its own typed section, empty where it has none."""

from __future__ import annotations

from galloping.fields import Section, one_of, real, setting, whole

Positive = real(gt=0)
IDENTIFIED, KNOWN = "identified", "known"  # the kinematic equations


class NoOptions(Section):
    """A method without settings."""


class Thresholded(Section):
    """A threshold on terms."""

    threshold: Positive | None = setting(
        None,
        "in the method's unit; null: each equation chooses its own from the data",
        "1",
    )


class Scanned(Thresholded):
    """A threshold, chosen out of a path of candidates."""

    path_length: whole(ge=5, le=1000) = setting(
        30, "candidate thresholds scanned where the data choose", "1"
    )


class Paper(Scanned):
    """The paper's method."""

    kinematics: one_of((IDENTIFIED, KNOWN)) = setting(
        IDENTIFIED,
        "that the rate of a displacement is its velocity: identified as any equation, or known",
    )


class Ensemble(Scanned):
    """An ensemble."""

    models: whole(ge=2, le=1000) = setting(20, "bagged models of an ensemble", "1")

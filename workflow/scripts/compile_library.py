"""Compile what a first fit needs, so that no user waits; numba caches it beside the library."""

import numpy as np

import galloping

# Coefficients of the acceleration by library. Each kind of term is compiled separately: powers,
# smooth functions and kinks.
OSCILLATORS = {
    "q + dq + q^2*dq": [-9, 0.5, -0.5],
    "q + dq + sin(q)": [-1, -0.05, -8],
    "q + dq + sign(dq)": [-9, -0.05, -0.3],
}


def simulate_forced(time: np.ndarray) -> np.ndarray:
    """Simulate the (n, 2) displacement and velocity of an oscillator in white-noise forces."""
    step, states = time[1] - time[0], np.zeros((len(time), 2))
    for k, kick in enumerate(np.random.default_rng(1).normal(size=len(time) - 1)):
        q, dq = states[k]
        dq += step * (-9.0 * q - 0.2 * dq) + np.sqrt(step) * kick
        states[k + 1] = q + step * dq, dq
    return states


def main() -> None:
    """Call the library's main functions once, so that numba compiles and caches their code."""
    time = np.arange(600) / 20
    for library, coefficients in OSCILLATORS.items():
        terms, _ = galloping.library(library, ["q", "dq"])
        line = galloping.PolynomialModel(("q", "dq"), terms, [[0, 1, 0], coefficients])
        motion = galloping.simulate(line, [2.0, 0.0], time)
        galloping.cramer_rao_bound(line, [2.0, 0.0], time, [0.1, 0.1])
        galloping.maximum_likelihood(galloping.measure(line, motion, level=0.05), terms)
    forced = galloping.Recording(time, ("q", "dq"), simulate_forced(time) * [1.0, np.nan])
    terms, _ = galloping.library(next(iter(OSCILLATORS)), ["q", "dq"])
    identified = galloping.maximum_likelihood(forced, terms)
    galloping.forecast(identified, forced, time[-1] + time[1:20])


if __name__ == "__main__":
    main()

"""Uniform cubic B-splines through rows of samples: smooth to the second derivative, and monotone where the samples are.

Values are weighted means of neighboring samples, so a curve never leaves their range. It passes each sample within a
sixth of its second difference.

``samples`` (n, columns) are ``step`` seconds apart; ``count`` of them, from row ``first`` on, are one curve.
"""

from crowdsim.jit import helper


@helper
def span_of(time, step, first, count):
    """Return the row of the sample that begins the span containing ``time``, and the share of the span that has passed.

    time: [s] from sample ``first``, limited to the second and the last but one sample. step: seconds between samples.
    count: samples of the curve, at least 4.
    """
    # Four samples surround a span, so spans begin at the second sample and end at the last but one.
    place = min(max(time / step, 1.0), count - 2.0)
    span = min(int(place), count - 3)
    return first + span, place - span


@helper
def weights_of(share):
    """Return the weights of the four samples around a span, at ``share`` of it (uniform cubic B-spline basis)."""
    rest = 1.0 - share
    square = share * share
    cube = square * share
    return (
        rest * rest * rest / 6.0,
        (3.0 * cube - 6.0 * square + 4.0) / 6.0,
        (-3.0 * cube + 3.0 * square + 3.0 * share + 1.0) / 6.0,
        cube / 6.0,
    )


@helper
def value_at(samples, column, span, weights):
    """Return the value of a column of ``samples``, given the span and weights of a time.

    span: row that begins it (:func:`span_of`). weights: four (:func:`weights_of`).
    """
    return (
        weights[0] * samples[span - 1, column]
        + weights[1] * samples[span, column]
        + weights[2] * samples[span + 1, column]
        + weights[3] * samples[span + 2, column]
    )


@helper
def time_of_value(samples, column, target, step, first, count, start):
    """Return the time [s] at which a non-decreasing column first reaches ``target``, and the span.

    Time and span count from sample ``first`` on. start: span from which to search, at least 1. If the curve has passed
    the target there, the time is that of the beginning of this span; if it never reaches the target, that of its end.
    """
    # Find the span at whose end (weights 1/6, 4/6, 1/6) the curve has reached the target.
    span = start
    while span < count - 3:
        end = value_at(samples, column, first + span, (0.0, 1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0))
        if end >= target:
            break
        span += 1
    # Bisect, to 2^-24 of a step; the curve is monotone in the span.
    low = 0.0
    high = 1.0
    for _ in range(24):
        middle = 0.5 * (low + high)
        if value_at(samples, column, first + span, weights_of(middle)) < target:
            low = middle
        else:
            high = middle
    return (span + high) * step, span

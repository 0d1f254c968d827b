"""Uniform cubic B-splines through rows of samples: smooth to the second derivative, and monotone where the samples are.

Sums of products of neighbouring samples, so a curve never leaves the samples' range. It passes within a sixth of a
second difference of each sample: 4 mm for an acceleration of 2.5 m/s2 at 10 Hz.
"""

from crowdsim.jit import helper


@helper
def span_of(time, step, first, count):
    """Sample that begins the span which holds ``time``, and the share of the span that is past.

    time: seconds from sample ``first``. step: seconds between samples. count: samples of the curve, at least 4. Times
    before the second sample or after the last but one are moved there.
    """
    place = min(max(time / step, 1.0), count - 2.0)
    span = min(int(place), count - 3)
    return first + span, place - span


@helper
def weights_of(share):
    """Weights of the four samples about a span, at ``share`` of it."""
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
    """Value of a column of ``samples`` (T, C) with the span and weights of a time."""
    return (
        weights[0] * samples[span - 1, column]
        + weights[1] * samples[span, column]
        + weights[2] * samples[span + 1, column]
        + weights[3] * samples[span + 2, column]
    )


@helper
def time_of_value(samples, column, target, step, first, count, start):
    """Seconds from sample ``first`` at which a non-decreasing column first reaches ``target``.

    start: span to look from, at or before the one that is meant. Returns the time and the span, relative to ``first``.
    Before the beginning of the curve the time is its beginning, after its end its end.
    """
    # Find the span at whose end the curve has reached the target.
    span = start
    while span < count - 3:
        end = value_at(samples, column, first + span, (0.0, 1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0))
        if end >= target:
            break
        span += 1
    # Halve: the curve is monotone in the span.
    low = 0.0
    high = 1.0
    for _ in range(24):
        middle = 0.5 * (low + high)
        if value_at(samples, column, first + span, weights_of(middle)) < target:
            low = middle
        else:
            high = middle
    return (span + high) * step, span

class Chart:
    """A plane (x, y) with the area form rho dx dy: q = y, p = the integral of rho over x, over the scale."""

    def __init__(self, low, high, scale, degrees, density, primitive):
        self.low, self.high, self.scale = low, high, scale
        self.columns, self.rows = degrees[0] + 1, degrees[1] + 1
        self.density, self.primitive = density, primitive

    def unit(self, axis, value):
        low, high = self.low[axis], self.high[axis]
        return (2.0 * value - (low + high)) / (high - low)

    def along_x(self, coefficients, count, t):
        """The coefficients along x of a sum of products of Chebyshev polynomials."""
        terms = [xp.ones_like(t), t]
        while len(terms) < self.rows:
            terms.append(2.0 * t * terms[-1] - terms[-2])
        return [
            sum(coefficients[k * count + j] * terms[k] for k in range(self.rows))
            for j in range(count)
        ]


def chebyshev(series, s):
    last, before = xp.zeros_like(s), xp.zeros_like(s)
    for c in reversed(series[1:]):
        last, before = 2.0 * s * last + (c - before), last
    return s * last + (series[0] - before)


def to_canonical(chart, x, y):
    s, t = chart.unit(0, x), chart.unit(1, y)
    p = chebyshev(chart.along_x(chart.primitive, chart.columns + 1, t), s)
    (left, bottom), (right, top) = chart.low, chart.high
    inside = (x >= left) & (x <= right) & (y >= bottom) & (y <= top)
    nan = xp.full_like(p, float("nan"))
    return xp.where(inside, y, nan), xp.where(inside, p, nan)


def to_data(chart, q, p):
    t = chart.unit(1, q)
    series = chart.along_x(chart.primitive, chart.columns + 1, t)
    density = chart.along_x(chart.density, chart.columns, t)
    slope = 0.5 * (chart.high[0] - chart.low[0]) / chart.scale

    def newton(s, series, density, p):
        return s - (chebyshev(series, s) - p) / (slope * chebyshev(density, s))

    fixed = [constant_of(c) for c in series], [constant_of(c) for c in density], constant_of(p)
    one = xp.ones_like(p)
    first, last = chebyshev(fixed[0], -one) - fixed[2], chebyshev(fixed[0], one) - fixed[2]
    inside = (q >= chart.low[1]) & (q <= chart.high[1]) & (first <= 1e-15 * (last - first)) & (last >= -1e-15 * (last - first))
    low, high, s = -one, one, constant_of(-first / (last - first) * 2.0 - 1.0)

    def halve(state):
        low, high, s = state
        s = xp.where((s > low) & (s < high), s, 0.5 * (low + high))
        missed = chebyshev(fixed[0], s) - fixed[2]
        low, high = xp.where(missed > 0.0, low, s), xp.where(missed > 0.0, s, high)
        return low, high, newton(s, *fixed)

    s = times(halve, 40, (low, high, s))[2]
    s = constant_of(xp.clip(s, -1.0, 1.0))
    # Each step from the solution has the next derivative right.
    for _ in range(2):
        s = newton(s, series, density, p)
    x = 0.5 * (chart.high[0] - chart.low[0]) * s + 0.5 * (chart.low[0] + chart.high[0])
    nan = xp.full_like(x, float("nan"))
    return xp.where(inside, x, nan), xp.where(inside, q, nan)

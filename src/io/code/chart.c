/* A plane (x, y) of a section with the area form rho dx dy: q = y, p = the integral of rho over x. */
typedef struct {
    double low[2], high[2], scale;
    int degrees[2];
    const double *coefficients;
} chart;

static double chart_unit(double low, double high, double value) {
    return (2.0 * value - (low + high)) / (high - low);
}

/* The sum of series[j] T_j(s). */
static double chebyshev(const double *series, int count, double s) {
    double b = 0.0, before = 0.0;
    for (int j = count - 1; j > 0; j--) {
        const double next = fma(2.0 * s, b, series[j] - before);
        before = b;
        b = next;
    }
    return fma(s, b, series[0] - before);
}

/* The coefficients along x of rho at y, and those of its derivative by y. */
static void along_x(const chart *of, double y, double *values, double *slopes) {
    const double t = chart_unit(of->low[1], of->high[1], y);
    const double slope = 2.0 / (of->high[1] - of->low[1]);
    const int count = of->degrees[0] + 1;
    double terms[2] = {1.0, t}, derivatives[2] = {0.0, 1.0};
    for (int j = 0; j < count; j++) {
        values[j] = 0.0;
        slopes[j] = 0.0;
    }
    for (int k = 0; k <= of->degrees[1]; k++) {
        const double *row = of->coefficients + k * count;
        for (int j = 0; j < count; j++) {
            values[j] += row[j] * terms[0];
            slopes[j] += row[j] * derivatives[0] * slope;
        }
        const double next = 2.0 * t * terms[1] - terms[0];
        const double next_derivative = 2.0 * (terms[1] + t * derivatives[1]) - derivatives[0];
        terms[0] = terms[1];
        terms[1] = next;
        derivatives[0] = derivatives[1];
        derivatives[1] = next_derivative;
    }
}

/* The integral of a series from the middle of the box, over the scale: one number more. */
static void integral(const chart *of, const double *series, double *out) {
    const double half = 0.5 * (of->high[0] - of->low[0]) / of->scale;
    const int count = of->degrees[0] + 1;
    out[0] = 0.0;
    for (int j = 1; j <= count; j++) {
        const double before = j == 1 ? 2.0 * series[0] : series[j - 1];
        const double after = j + 1 < count ? series[j + 1] : 0.0;
        out[j] = half * (before - after) / (2.0 * j);
    }
    out[0] = -chebyshev(out, count + 1, 0.0);
}

static int chart_contains(const chart *of, double x, double y) {
    return x >= of->low[0] && x <= of->high[0] && y >= of->low[1] && y <= of->high[1];
}

static void chart_to_canonical(const chart *of, double *x, double *y) {
    double values[CHART_SIZE], slopes[CHART_SIZE], primitive[CHART_SIZE];
    if (!chart_contains(of, *x, *y)) {
        *x = NAN;
        *y = NAN;
        return;
    }
    along_x(of, *y, values, slopes);
    integral(of, values, primitive);
    const double p = chebyshev(primitive, of->degrees[0] + 2, chart_unit(of->low[0], of->high[0], *x));
    *x = *y;
    *y = p;
}

static void chart_to_data(const chart *of, double *q, double *p) {
    const double y = *q, wanted = *p;
    const int count = of->degrees[0] + 1;
    double values[CHART_SIZE], slopes[CHART_SIZE], primitive[CHART_SIZE];
    *q = NAN;
    *p = NAN;
    if (!(y >= of->low[1] && y <= of->high[1])) {
        return;
    }
    along_x(of, y, values, slopes);
    integral(of, values, primitive);
    const double slope = 0.5 * (of->high[0] - of->low[0]) / of->scale;
    double low = -1.0, high = 1.0;
    const double first = chebyshev(primitive, count + 1, low) - wanted;
    const double last = chebyshev(primitive, count + 1, high) - wanted;
    const double rounding = 4.0 * DBL_EPSILON * (last - first);
    if (!(first <= rounding && last >= -rounding)) {
        return;
    }
    double s = -first / (last - first) * 2.0 - 1.0;
    for (int k = 0; k < CHART_STEPS; k++) {
        s = s > low && s < high ? s : 0.5 * (low + high);
        const double missed = chebyshev(primitive, count + 1, s) - wanted;
        if (missed > 0.0) {
            high = s;
        } else {
            low = s;
        }
        const double step = missed / (slope * chebyshev(values, count, s));
        s -= step;
        if (fabs(step) <= DBL_EPSILON) {
            break;
        }
    }
    s = s < -1.0 ? -1.0 : s > 1.0 ? 1.0 : s;
    *q = fma(0.5, (of->high[0] - of->low[0]) * s, 0.5 * (of->low[0] + of->high[0]));
    *p = y;
}

/* The derivatives of p by x and by y. */
static void chart_slopes(const chart *of, double x, double y, double out[2]) {
    double values[CHART_SIZE], slopes[CHART_SIZE], primitive[CHART_SIZE];
    const double s = chart_unit(of->low[0], of->high[0], x);
    along_x(of, y, values, slopes);
    integral(of, slopes, primitive);
    out[0] = chebyshev(values, of->degrees[0] + 1, s) / of->scale;
    out[1] = chebyshev(primitive, of->degrees[0] + 2, s);
}

//! Numbers in words: what verdicts and tables write alike.

/// A number in subscript digits, such as `₁₂` for 12.
pub(crate) fn subscript(number: usize) -> String {
    const ZERO: u32 = '₀' as u32;
    let digits = number.to_string();
    digits.bytes().filter_map(|digit| char::from_u32(ZERO + u32::from(digit - b'0'))).collect()
}

/// `1.234` between a thousandth and ten thousand, `1.23e-5` elsewhere.
pub(crate) fn magnitude(value: f64) -> String {
    match value {
        0.0 => "0".into(),
        _ if (1e-3..1e4).contains(&value.abs()) => format!("{value:.3}"),
        _ => format!("{value:.2e}"),
    }
}

/// A factor: `7.6 ×`, `0.83 ×`, `3.4e-3 ×`.
pub(crate) fn factor(value: f64) -> String {
    const MANY_DIGITS: f64 = 1e5;
    // One digit behind the point would be off by half of it.
    const SHARE: f64 = 0.995;
    const FEW_DIGITS: f64 = 0.0095;
    match value.abs() {
        size if size < FEW_DIGITS && size > 0.0 => format!("{value:.1e} ×"),
        size if size < SHARE && size > 0.0 => format!("{value:.2} ×"),
        size if size < MANY_DIGITS => format!("{value:.1} ×"),
        _ => format!("{value:.1e} ×"),
    }
}

/// A share, in two digits: `3.4 %`, `0.012 %`.
pub(crate) fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    let places = 1.0 - libm::floor(libm::log10(percent.abs()));
    // Infinite at 0, NaN and ∞.
    match places {
        // Noughts are no digits.
        places if places > 6.0 && places.is_finite() => format!("{percent:.1e} %"),
        places if places.is_finite() => format!("{percent:.0$} %", places.max(0.0) as usize),
        _ => format!("{percent:.0} %"),
    }
}

/// The name of plane j, counted from 0, such as `plane 2 (q₂, p₂)` for j = 1.
pub(crate) fn plane_name(j: usize) -> String {
    format!("plane {} (q{}, p{})", j + 1, subscript(j + 1), subscript(j + 1))
}

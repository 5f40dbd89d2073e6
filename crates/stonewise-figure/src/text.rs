//! Text of the report: escaping and numbers.

/// Makes any text harmless inside HTML and SVG, in elements and in quoted attributes.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            // Control characters are not allowed in XML and show nothing in HTML.
            c if c.is_control() && c != '\n' && c != '\t' => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// A number with this many decimals and a true minus sign; a dash where it is not finite.
pub fn number(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let text = format!("{value:.decimals$}");
    // -0.0 and -0.04 with one decimal are both plain zero.
    let unsigned = text.trim_start_matches('-');
    if text == unsigned || unsigned.chars().all(|c| c == '0' || c == '.') {
        unsigned.into()
    } else {
        format!("\u{2212}{unsigned}")
    }
}

/// Metres as millimetres with one decimal, from 100 mm on without, below 1 mm with two.
pub fn mm(metres: f64) -> String {
    let value = metres * 1e3;
    let decimals = match value.abs() {
        v if v >= 99.95 => 0,
        v if v >= 0.995 || v == 0.0 => 1,
        _ => 2,
    };
    number(value, decimals)
}

/// A whole number with thin spaces between thousands.
pub fn count(value: usize) -> String {
    let digits = value.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(digit);
    }
    out
}

/// "12 %" of a whole; a dash where there is no whole.
pub fn percent(part: usize, whole: usize) -> String {
    if whole == 0 {
        return "–".into();
    }
    let share = 100.0 * part as f64 / whole as f64;
    let decimals = usize::from(share < 9.95 && part > 0);
    format!("{}\u{a0}%", number(share, decimals))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_in_names_is_harmless() {
        assert_eq!(
            escape("<script>\"a\" & 'b'\u{0}"),
            "&lt;script&gt;&quot;a&quot; &amp; &#39;b&#39;\u{fffd}"
        );
    }

    #[test]
    fn numbers_read_well() {
        assert_eq!(mm(0.012_34), "12.3");
        assert_eq!(mm(-0.000_123), "\u{2212}0.12");
        assert_eq!(mm(0.1234), "123");
        assert_eq!(mm(0.0), "0.0");
        assert_eq!(number(-0.04, 1), "0.0");
        assert_eq!(mm(f64::INFINITY), "–");
        assert_eq!(count(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!(percent(1, 0), "–");
        assert_eq!(percent(50, 100), "50\u{a0}%");
    }
}

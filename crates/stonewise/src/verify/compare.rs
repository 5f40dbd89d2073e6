//! Values of two files within a tolerance.

use serde::Serialize;
use serde_json::Value;

/// How far two numbers may lie apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tolerance {
    /// As they are.
    pub absolute: f64,
    /// As a share of the larger.
    pub relative: f64,
}

impl Tolerance {
    /// What is lost where a number is written as text and read again.
    pub const ROUNDING: Self = Self {
        absolute: 0.0,
        relative: 1e-12,
    };
    /// Where normals of faces come from `outlines.json`, which rounds them: a micrometre, and a thousandth.
    pub const NORMALS: Self = Self {
        absolute: 1e-6,
        relative: 1e-3,
    };
    /// Between processors of different classes, and builds of the same method: 0.03 mm or mrad, and three
    /// hundredths.
    pub const MACHINES: Self = Self {
        absolute: 3e-5,
        relative: 3e-2,
    };
    /// The same for variances: the square of 0.03 mm, and a tenth.
    const VARIANCES: Self = Self {
        absolute: 1e-9,
        relative: 0.1,
    };
    /// The same for what single photos show, which the adjustment averages.
    const PHOTOS: Self = Self {
        absolute: 1e-4,
        relative: 0.1,
    };

    /// The tolerance between machines for a quantity of this name.
    pub fn of_machines(name: &str) -> Self {
        match name {
            name if name.contains("cov") => Self::VARIANCES,
            name if name.starts_with("photos_") || name.starts_with("shift_") => Self::PHOTOS,
            _ => Self::MACHINES,
        }
    }

    fn admits(self, a: f64, b: f64) -> bool {
        let apart = (a - b).abs();
        a == b || (a.is_nan() && b.is_nan()) || apart <= self.absolute + self.relative * a.abs().max(b.abs())
    }
}

/// A value as JSON; null where it cannot be.
pub(super) fn json(value: &impl Serialize) -> Value {
    serde_json::to_value(value).unwrap_or_default()
}

/// Where two documents differ first by more than the tolerance of the innermost name, in words.
pub(super) fn first_difference(
    a: &Value,
    b: &Value,
    tolerance: &dyn Fn(&str) -> Tolerance,
) -> Option<String> {
    different_at("", "", a, b, tolerance)
}

fn different_at(
    path: &str,
    name: &str,
    a: &Value,
    b: &Value,
    tolerance: &dyn Fn(&str) -> Tolerance,
) -> Option<String> {
    let below = |part: &str| match path {
        "" => part.to_owned(),
        path => format!("{path}.{part}"),
    };
    match (a, b) {
        (Value::Object(a), Value::Object(b)) => {
            let names = a.keys().chain(b.keys().filter(|key| !a.contains_key(*key)));
            names
                .filter_map(|key| {
                    let values = [a.get(key), b.get(key)].map(|v| v.unwrap_or(&Value::Null));
                    different_at(&below(key), key, values[0], values[1], tolerance)
                })
                .next()
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => a
            .iter()
            .zip(b)
            .enumerate()
            .find_map(|(i, (a, b))| different_at(&below(&i.to_string()), name, a, b, tolerance)),
        // Counts and numbers of stones are equal or not.
        (Value::Number(x), Value::Number(y)) if !(x.is_u64() && y.is_u64()) => {
            let [x, y] = [x, y].map(|n| n.as_f64().unwrap_or(f64::NAN));
            (!tolerance(name).admits(x, y)).then(|| format!("{path}: {a} and {b}"))
        }
        // Sentences repeat numbers that stand elsewhere.
        (Value::String(x), Value::String(y))
            if tolerance(name).absolute > 0.0 && without_numbers(x) == without_numbers(y) =>
        {
            None
        }
        _ if a == b => None,
        _ => Some(format!("{path}: {} and {}", brief(a), brief(b))),
    }
}

fn without_numbers(text: &str) -> String {
    text.chars().filter(|c| !c.is_ascii_digit()).collect()
}

/// A value in a few words.
fn brief(value: &Value) -> String {
    match value {
        Value::Array(all) => format!("{} values", all.len()),
        Value::Object(_) => "an object".to_owned(),
        value => value.to_string(),
    }
}

/// Where two tables of text differ first by more than the tolerance of the column, in words.
pub(super) fn first_cell(a: &str, b: &str, tolerance: &dyn Fn(&str) -> Tolerance) -> Option<String> {
    let head: Vec<&str> = a.lines().next().unwrap_or_default().split(',').collect();
    for (number, (x, y)) in a.lines().zip(b.lines()).enumerate() {
        if x == y {
            continue;
        }
        let (x, y): (Vec<&str>, Vec<&str>) = (x.split(',').collect(), y.split(',').collect());
        let place = |column: usize| {
            let name = head.get(column).copied().unwrap_or_default();
            format!("line {}, column {name}", number + 1)
        };
        if x.len() != y.len() {
            return Some(format!("line {}: {} and {} cells", number + 1, x.len(), y.len()));
        }
        for (column, (x, y)) in x.iter().zip(&y).enumerate() {
            let tolerance = tolerance(head.get(column).copied().unwrap_or_default());
            let are_counts = [x, y].iter().all(|cell| cell.parse::<u64>().is_ok());
            let is_same = match (x.parse::<f64>(), y.parse::<f64>()) {
                (Ok(x), Ok(y)) if !are_counts => tolerance.admits(x, y),
                _ => x == y,
            };
            if !is_same {
                return Some(format!("{}: {x:?} and {y:?}", place(column)));
            }
        }
    }
    let rows = [a, b].map(|text| text.lines().count());
    (rows[0] != rows[1]).then(|| format!("{} and {} lines", rows[0], rows[1]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_first_difference_is_named_by_its_path() {
        let a = json!({ "n": 3, "wall": { "rmse_m": [1.0, 2.0], "cov": 1e-8 } });
        let exact = |_: &str| Tolerance::ROUNDING;
        assert_eq!(first_difference(&a, &a, &exact), None);
        let b = json!({ "n": 3, "wall": { "rmse_m": [1.0, 2.000_005], "cov": 1e-8 } });
        let difference = first_difference(&a, &b, &exact).unwrap();
        assert!(difference.starts_with("wall.rmse_m.1: 2.0 and "), "{difference}");
        let machines = |name: &str| Tolerance::of_machines(name);
        assert_eq!(first_difference(&a, &b, &machines), None);
        let wider = json!({ "n": 3, "wall": { "rmse_m": [1.0, 2.0], "cov": 1.5e-8 } });
        assert!(first_difference(&a, &wider, &machines).is_some());
        assert!(first_difference(&a, &json!({ "n": 3 }), &machines).is_some());
        let [said, other] = ["limit 2.1 mm", "limit 2.0 mm"].map(|text| json!({ "sentence": text }));
        assert_eq!(first_difference(&said, &other, &machines), None);
        assert!(first_difference(&said, &other, &exact).is_some());
    }

    #[test]
    fn cells_are_compared_as_numbers_within_the_tolerance_of_their_column() {
        let machines = |name: &str| Tolerance::of_machines(name);
        let a = "stone_id,dx,cov_xx,status\n1,0.01,1e-8,ok\n2,,,unmatched_lost\n";
        assert_eq!(first_cell(a, &a.replace("0.01", "0.010005"), &machines), None);
        let moved = first_cell(a, &a.replace("0.01", "0.0105"), &machines);
        assert_eq!(moved.unwrap(), "line 2, column dx: \"0.01\" and \"0.0105\"");
        let many = a.replace("\n1,", "\n100,");
        assert!(first_cell(&many, &many.replace("100,", "101,"), &machines).is_some());
        for (from, to) in [
            ("1e-8", "1.5e-8"),
            (",ok", ",failed_points"),
            ("2,,", "2,0,"),
            ("2,,,unmatched_lost\n", ""),
        ] {
            assert!(first_cell(a, &a.replace(from, to), &machines).is_some(), "{from}");
        }
    }
}

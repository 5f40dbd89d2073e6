//! Values of two files within a tolerance.

use serde::Serialize;
use serde_json::{Map, Value};
use std::path::Path;
use stonewise_io::table::{CsvError, CsvFile, CsvRow};

/// How far two numbers may lie apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tolerance {
    /// Absolute difference.
    pub absolute: f64,
    /// Difference as a share of the larger number.
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
    /// Tolerance between processors of different classes, and builds of the same method: 0.03 mm or mrad, and three
    /// hundredths.
    pub const MACHINES: Self = Self {
        absolute: 3e-5,
        relative: 3e-2,
    };
    /// Tolerance between machines for variances: the square of 0.03 mm, and a tenth.
    const VARIANCES: Self = Self {
        absolute: 1e-9,
        relative: 0.1,
    };
    /// Tolerance between machines for what single photos show, which the adjustment averages.
    const PHOTOS: Self = Self {
        absolute: 1e-4,
        relative: 0.1,
    };

    /// Tolerance between machines for turns of stones that photos alone show: 0.1 mm on a stone of a few centimetres.
    const TURNS: Self = Self {
        absolute: 3e-3,
        relative: 0.1,
    };
    /// Tolerance between machines for probabilities, some of which are shares of 999 simulations.
    const PROBABILITIES: Self = Self {
        absolute: 2e-2,
        relative: 3e-2,
    };
    /// Tolerance between machines for lengths in millimetres and pixels.
    const MILLIMETRES: Self = Self {
        absolute: 3e-2,
        relative: 3e-2,
    };

    /// Which of two photos that show a stone equally well its picture is cut from.
    const CHOICE: Self = Self {
        absolute: f64::INFINITY,
        relative: 0.0,
    };

    /// The tolerance between machines for a quantity of this name.
    pub fn of_machines(name: &str) -> Self {
        match name {
            "photo_1" | "photo_2" => Self::CHOICE,
            "p" => Self::PROBABILITIES,
            "turn_rad" | "turn_sd_rad" => Self::TURNS,
            name if name.starts_with("p_") => Self::PROBABILITIES,
            name if name.ends_with("_mm") || name.ends_with("_px") => Self::MILLIMETRES,
            name if name.contains("cov") => Self::VARIANCES,
            name if name.starts_with("photos_") || name.starts_with("shift_") => Self::PHOTOS,
            _ => Self::MACHINES,
        }
    }

    /// `size`: what the relative part refers to if the numbers themselves are smaller. A covariance is small
    /// beside the variances that it belongs to where their errors are independent.
    fn admits(self, a: f64, b: f64, size: f64) -> bool {
        let apart = (a - b).abs();
        let size = a.abs().max(b.abs()).max(size);
        a == b || (a.is_nan() && b.is_nan()) || apart <= self.absolute + self.relative * size
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
    different_at("", "", 0.0, a, b, tolerance)
}

fn different_at(
    path: &str,
    name: &str,
    size: f64,
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
                    let size = deviations_of(key, a);
                    different_at(&below(key), key, size, values[0], values[1], tolerance)
                })
                .next()
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            let deviations = deviations(name, a);
            let row = |(i, (a, b)): (usize, (&Value, &Value))| {
                let path = below(&i.to_string());
                match (&deviations, a, b) {
                    (Some(sd), Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
                        let mut cells = a.iter().zip(b).zip(sd).enumerate();
                        cells.find_map(|(j, ((a, b), other))| {
                            different_at(&format!("{path}.{j}"), name, sd[i] * other, a, b, tolerance)
                        })
                    }
                    _ => different_at(&path, name, 0.0, a, b, tolerance),
                }
            };
            a.iter().zip(b).enumerate().find_map(row)
        }
        // Counts and numbers of stones are equal or not.
        (Value::Number(x), Value::Number(y)) if !(x.is_u64() && y.is_u64()) => {
            let [x, y] = [x, y].map(|n| n.as_f64().unwrap_or(f64::NAN));
            (!tolerance(name).admits(x, y, size)).then(|| format!("{path}: {a} and {b}"))
        }
        // Sentences repeat numbers that stand elsewhere.
        (Value::String(x), Value::String(y))
            if tolerance(name).absolute > 0.0
                && x.contains(' ')
                && without_numbers(x) == without_numbers(y) =>
        {
            None
        }
        _ if a == b || tolerance(name).absolute.is_infinite() => None,
        _ => Some(format!("{path}: {} and {}", brief(a), brief(b))),
    }
}

/// The standard deviations of a covariance matrix; `None` of anything else.
fn deviations(name: &str, rows: &[Value]) -> Option<Vec<f64>> {
    let variance = |(i, row): (usize, &Value)| {
        let row = row.as_array().filter(|row| row.len() == rows.len())?;
        row[i].as_f64()
    };
    let variances = rows
        .iter()
        .enumerate()
        .map(variance)
        .collect::<Option<Vec<f64>>>()?;
    name.contains("cov")
        .then(|| variances.into_iter().map(f64::sqrt).collect())
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

/// Of a covariance such as `cov_rel_xy` or `shift_cov_along_up`: the product of the two standard deviations among
/// the values beside it; 0 of anything else. Axes are letters or words.
fn deviations_of(name: &str, beside: &Map<String, Value>) -> f64 {
    let Some((stem, last)) = name.rsplit_once('_').filter(|_| name.contains("cov")) else {
        return 0.0;
    };
    let letters: Vec<char> = last.chars().collect();
    let by_letters = match letters.as_slice() {
        [a, b] => Some([a, b].map(|axis| format!("{stem}_{axis}{axis}"))),
        _ => None,
    };
    let by_words = stem
        .rsplit_once('_')
        .map(|(stem, first)| [first, last].map(|axis| format!("{stem}_{axis}_{axis}")));
    let variance = |name: &String| beside.get(name)?.as_f64();
    let product = |[a, b]: [String; 2]| Some((variance(&a)? * variance(&b)?).sqrt());
    let mut products = by_letters.into_iter().chain(by_words).filter_map(product);
    products.next().unwrap_or(0.0)
}

/// Where two tables of text differ first by more than the tolerance of the column, in words; what is wrong with one that
/// is no table.
pub(super) fn first_cell(a: &str, b: &str, tolerance: &dyn Fn(&str) -> Tolerance) -> Option<String> {
    first_of_cells(a, b, tolerance).unwrap_or_else(|e| Some(e.said()))
}

fn first_of_cells(
    a: &str,
    b: &str,
    tolerance: &dyn Fn(&str) -> Tolerance,
) -> Result<Option<String>, CsvError> {
    let read = |text: &str| CsvFile::parse(Path::new(""), text);
    let (a, b) = (read(a)?, read(b)?);
    if a.head() != b.head() {
        let [x, y] = [&a, &b].map(|table| table.head().join(","));
        return Ok(Some(format!("line 1: {x:?} and {y:?}")));
    }
    let value = |cell: &str| serde_json::from_str(cell).unwrap_or_else(|_| Value::from(cell));
    let object = |row: &CsvRow<'_>| {
        let cells = a.head().iter().enumerate();
        Value::Object(
            cells
                .map(|(i, name)| (name.to_string(), value(row.text(i))))
                .collect(),
        )
    };
    let is_same = |x: &CsvRow<'_>, y: &CsvRow<'_>| (0..a.head().len()).all(|i| x.text(i) == y.text(i));
    let (mut of_a, mut of_b) = (a.rows(), b.rows());
    for line in 2.. {
        let difference = match (of_a.next().transpose()?, of_b.next().transpose()?) {
            (Some(x), Some(y)) if is_same(&x, &y) => None,
            (Some(x), Some(y)) => different_at(
                &format!("line {line}"),
                "",
                0.0,
                &object(&x),
                &object(&y),
                tolerance,
            ),
            (None, None) => break,
            _ => Some(format!("{} and {} rows", a.rows().count(), b.rows().count())),
        };
        if difference.is_some() {
            return Ok(difference);
        }
    }
    Ok(None)
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
        // Almost independent errors: what their covariance is says nothing beside their variances.
        let matrix = |off: f64| json!({ "covariance": [[1e-6, off], [off, 1e-4]] });
        assert_eq!(first_difference(&matrix(1e-8), &matrix(5e-7), &machines), None);
        let difference = first_difference(&matrix(1e-8), &matrix(3e-6), &machines).unwrap();
        assert!(difference.starts_with("covariance.0.1: "), "{difference}");
        let [half, less, much_less] = [0.5, 0.49, 0.45].map(|p| json!({ "p": p }));
        assert_eq!(first_difference(&half, &less, &machines), None);
        assert!(first_difference(&half, &much_less, &machines).is_some());
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
        assert_eq!(moved.unwrap(), "line 2.dx: 0.01 and 0.0105");
        let table = |off: &str| format!("stone_id,cov_xx,cov_xy,cov_yy\n1,1e-6,{off},1e-4\n");
        assert_eq!(first_cell(&table("1e-8"), &table("5e-7"), &machines), None);
        let other = first_cell(&table("1e-8"), &table("3e-6"), &machines).unwrap();
        assert!(other.starts_with("line 2.cov_xy"), "{other}");
        let by_words = |text: String| {
            text.replace("cov_xx", "shift_cov_along_along")
                .replace("cov_xy", "shift_cov_along_up")
                .replace("cov_yy", "shift_cov_up_up")
        };
        assert_eq!(
            first_cell(&by_words(table("1e-8")), &by_words(table("5e-7")), &machines),
            None
        );
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

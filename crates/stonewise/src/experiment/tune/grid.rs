//! Which values of which parameters are tried.

use crate::settings::{Estimator, Settings};
use std::str::FromStr;

/// One parameter and the values that are tried.
#[derive(Clone, Debug, PartialEq)]
pub struct Dimension {
    /// `section.key`, as in the project file.
    pub key: String,
    /// The values, in the order they were given.
    pub values: Vec<toml::Value>,
}

/// More values than this are a slip of the pen.
const MOST_VALUES: f64 = 1000.0;

impl FromStr for Dimension {
    type Err = String;

    /// Reads `key=a,b,c` or `key=from..to..step`; values that are no numbers or truth values are words.
    fn from_str(text: &str) -> Result<Self, String> {
        let (key, values) = text
            .split_once('=')
            .ok_or("write key=a,b,c or key=from..to..step")?;
        let values: Vec<toml::Value> = match values.contains("..") {
            true => range(values).ok_or("a range is from..to..step, three numbers, step above 0")?,
            false => values.split(',').map(|v| scalar(v.trim())).collect(),
        };
        if values.iter().any(|v| v.as_str() == Some("")) {
            return Err("a value is empty".to_owned());
        }
        Ok(Self {
            key: key.trim().to_owned(),
            values,
        })
    }
}

fn scalar(text: &str) -> toml::Value {
    let read = format!("x = {text}").parse::<toml::Table>();
    let found = read.ok().and_then(|mut table| table.remove("x"));
    found.unwrap_or_else(|| toml::Value::String(text.to_owned()))
}

fn range(text: &str) -> Option<Vec<toml::Value>> {
    let numbers: Vec<f64> = text
        .split("..")
        .map(|n| n.trim().parse().ok().filter(|v: &f64| v.is_finite()))
        .collect::<Option<_>>()?;
    let [from, to, step] = numbers[..] else {
        return None;
    };
    let count = ((to - from) / step + 1e-9).floor();
    let is_sensible = step > 0.0 && (0.0..MOST_VALUES).contains(&count);
    // Rounded, so that 0.2 + 0.1 reads 0.3.
    let value = |i: usize| toml::Value::Float(((from + i as f64 * step) * 1e9).round() / 1e9);
    is_sensible.then(|| (0..=count as usize).map(value).collect())
}

/// The grid that is tried where none is given: the paper's three parameters, with values on both sides of its
/// choice.
///
/// The buffer belongs to plane-to-plane ICP; the adjustment has the border instead that it leaves out of
/// every stone.
pub fn default_grid(settings: &Settings) -> Vec<Dimension> {
    let dimension = |key: &str, values: &[f64]| Dimension {
        key: key.to_owned(),
        values: values.iter().map(|v| toml::Value::Float(*v)).collect(),
    };
    let last = match settings.registration.estimator {
        Estimator::Gicp => dimension("registration.gicp.buffer_m", &[0.0, 0.15, 0.3, 0.6, 0.9]),
        Estimator::Adjustment => dimension("registration.border_noises", &[0.0, 1.5, 3.0, 5.0]),
    };
    vec![
        dimension("match.max_ratio", &[0.3, 0.4, 0.5, 0.6]),
        dimension("match.min_area_ratio", &[0.5, 0.7, 0.8, 0.9, 0.95]),
        last,
    ]
}

/// Every combination of values, the last dimension changing fastest.
pub(super) fn points(grid: &[Dimension]) -> Vec<Vec<toml::Value>> {
    grid.iter().fold(vec![Vec::new()], |points, dimension| {
        let longer = |point: &Vec<toml::Value>| {
            let values = dimension.values.iter();
            values
                .map(|v| [point.as_slice(), std::slice::from_ref(v)].concat())
                .collect::<Vec<_>>()
        };
        points.iter().flat_map(longer).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_and_ranges_are_read() {
        let list: Dimension = "registration.estimator=gicp, adjustment".parse().unwrap();
        assert_eq!(
            list.values,
            ["gicp", "adjustment"].map(|v| toml::Value::String(v.into()))
        );
        let mixed: Dimension = "a.b=1,0.5,true".parse().unwrap();
        assert_eq!(
            mixed.values,
            [
                toml::Value::Integer(1),
                toml::Value::Float(0.5),
                toml::Value::Boolean(true)
            ]
        );
        let range: Dimension = "a.b=0.2..0.5..0.1".parse().unwrap();
        assert_eq!(range.values, [0.2, 0.3, 0.4, 0.5].map(toml::Value::Float));
        for bad in [
            "a.b",
            "a.b=1..2",
            "a.b=1..2..0",
            "a.b=1,,2",
            "a.b=2..1..1",
            "a.b=0..1e9..1e-3",
        ] {
            assert!(bad.parse::<Dimension>().is_err(), "{bad}");
        }
    }

    #[test]
    fn the_grid_is_exhaustive() {
        let grid = ["a=1,2", "b=x,y,z"].map(|d| d.parse::<Dimension>().unwrap());
        let all = points(&grid);
        assert_eq!(all.len(), 6);
        assert_eq!(all[1], [toml::Value::Integer(1), toml::Value::String("y".into())]);
        assert_eq!(points(&[]), vec![Vec::<toml::Value>::new()]);
    }
}

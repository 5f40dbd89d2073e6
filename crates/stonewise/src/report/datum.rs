//! What is known about the registration of the epochs, and so about motions that all stones share.

use serde_json::Value;

/// Where the uncertainty of the epochs' registration comes from.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Datum {
    /// From areas that the project calls stable.
    StableAreas {
        /// What they seem to have done, metres, world axes; zero would be a perfect registration.
        shift_m: [f64; 3],
        /// Standard deviations of it, metres.
        sigma_m: [f64; 3],
        /// Points that were used in the two epochs.
        points: Vec<usize>,
    },
    /// Stated by the project: standard deviation of an epoch, per axis, metres.
    Stated(f64),
    /// Nothing is known: uncertainties hold for motions against each other only.
    Unknown,
}

impl Datum {
    /// What `run.json` and `registration.json` say.
    pub(crate) fn of(run: &Value, registration: &Value) -> Self {
        let stated = find_number(run, "epoch_error_m").filter(|e| *e > 0.0);
        stable_areas(registration)
            .or(stated.map(Self::Stated))
            .unwrap_or(Self::Unknown)
    }
}

fn stable_areas(registration: &Value) -> Option<Datum> {
    let areas = registration.get("stable_areas").filter(|a| a.is_object())?;
    let numbers = |key: &str| -> Vec<f64> {
        let list = areas.get(key).and_then(Value::as_array);
        list.map_or(Vec::new(), |l| l.iter().filter_map(Value::as_f64).collect())
    };
    let (shift, covariance) = (numbers("shift"), numbers("covariance"));
    let at = |list: &[f64], i: usize| list.get(i).copied().unwrap_or(f64::NAN);
    Some(Datum::StableAreas {
        shift_m: std::array::from_fn(|k| at(&shift, k)),
        // A 6 x 6 matrix in one list: its diagonal lies 7 apart.
        sigma_m: std::array::from_fn(|k| at(&covariance, 7 * k).max(0.0).sqrt()),
        points: numbers("points").iter().map(|n| *n as usize).collect(),
    })
}

/// The first number of this name anywhere in a document.
fn find_number(value: &Value, key: &str) -> Option<f64> {
    match value {
        Value::Object(map) => map
            .get(key)
            .and_then(Value::as_f64)
            .or_else(|| map.values().find_map(|v| find_number(v, key))),
        Value::Array(items) => items.iter().find_map(|v| find_number(v, key)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn run(epoch_error_m: f64) -> Value {
        json!({ "parameters": { "registration": { "epoch_error_m": epoch_error_m } } })
    }

    #[test]
    fn stable_areas_go_before_a_stated_error_and_zero_is_not_knowledge() {
        let none = json!({ "stable_areas": null });
        assert_eq!(Datum::of(&run(0.0), &none), Datum::Unknown);
        assert_eq!(Datum::of(&run(0.002), &none), Datum::Stated(0.002));
        let mut covariance = vec![0.0; 36];
        [covariance[0], covariance[7], covariance[14]] = [1e-6, 4e-6, 9e-6];
        let areas = json!({ "stable_areas": {
            "shift": [0.001, -0.002, 0.0], "covariance": covariance, "points": [1200, 1100],
        } });
        let Datum::StableAreas {
            shift_m,
            sigma_m,
            points,
        } = Datum::of(&run(0.002), &areas)
        else {
            panic!("stable areas were overlooked");
        };
        assert_eq!(shift_m, [0.001, -0.002, 0.0]);
        for (sigma, expected) in sigma_m.iter().zip([0.001, 0.002, 0.003]) {
            assert!((sigma - expected).abs() < 1e-12);
        }
        assert_eq!(points, [1200, 1100]);
    }
}

//! Parameters of M3C2.

use crate::params::{ParamError, Params, Range, Ranged, with_ranges};
use schemars::{JsonSchema, Schema};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

/// Parameters of M3C2.
///
/// In files the normal scale and the projection scale are given as a radius (`normal_radius_m`,
/// `cylinder_radius_m`) or as a diameter (`normal_diameter_m`, `cylinder_diameter_m`, the convention of Lague
/// et al. and of CloudCompare), never both. `max_depth_m` is a half-length: from the core point to either
/// end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "Keys")]
#[schemars(!try_from, default, deny_unknown_fields)]
#[schemars(transform = with_ranges::<Self>, transform = with_diameters)]
pub struct M3c2Params {
    /// Radius of the neighbourhood whose plane gives a core point its normal, metres.
    pub normal_radius_m: f64,
    /// Radius of the cylinder along the normal, metres.
    pub cylinder_radius_m: f64,
    /// How far the cylinder reaches from the core point to either side, metres.
    pub max_depth_m: f64,
    /// Edge of the voxels to which epoch 1 is thinned for core points, metres.
    pub core_spacing_m: f64,
    /// Median and interquartile range instead of mean and standard deviation.
    pub robust: bool,
    /// Fewer points than this in either cylinder give a distance but no detection limit.
    pub min_points: u32,
    /// Subtracted from n in the variance: 1 (sample, as py4dgeo) or 0 (as CloudCompare).
    pub ddof: u32,
    /// Error of the registration between the epochs (reg in the detection limit), metres.
    pub registration_error_m: f64,
}

impl Default for M3c2Params {
    fn default() -> Self {
        Self {
            // Some 25 times the roughness of rubble masonry (1 cm), the scale at which Lague et al. (2013)
            // find normals stable: it is the wall's normal, not the stone's.
            normal_radius_m: 0.25,
            // About 100 points of a UAV cloud (9 mm) and 300 of a TLS cloud (5 mm), well above the 20-30 that
            // the statistics of Lague et al. need, and smaller than most stones.
            cylinder_radius_m: 0.05,
            // Six times the largest motion in the paper; short enough not to reach railings and buildings.
            max_depth_m: 0.3,
            // The cylinder radius: neighbouring cylinders overlap by half.
            core_spacing_m: 0.05,
            robust: false,
            // CloudCompare's default.
            min_points: 5,
            // Unbiased for the small counts of sparse clouds.
            ddof: 1,
            registration_error_m: 0.0,
        }
    }
}

impl Params for M3c2Params {
    fn ranges(&self) -> Vec<Ranged> {
        vec![
            Range::POSITIVE.holds("normal_radius_m", self.normal_radius_m),
            Range::POSITIVE.holds("cylinder_radius_m", self.cylinder_radius_m),
            Range::POSITIVE.holds("max_depth_m", self.max_depth_m),
            Range::POSITIVE.holds("core_spacing_m", self.core_spacing_m),
            Range::NOT_NEGATIVE.holds("min_points", self.min_points),
            Range::between(0.0, 1.0).holds("ddof", self.ddof),
            Range::NOT_NEGATIVE.holds("registration_error_m", self.registration_error_m),
        ]
    }
}

/// The keys as files spell them.
#[derive(Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Keys {
    normal_radius_m: Option<f64>,
    normal_diameter_m: Option<f64>,
    cylinder_radius_m: Option<f64>,
    cylinder_diameter_m: Option<f64>,
    max_depth_m: f64,
    core_spacing_m: f64,
    robust: bool,
    min_points: u32,
    ddof: u32,
    registration_error_m: f64,
}

impl Default for Keys {
    fn default() -> Self {
        let params = M3c2Params::default();
        Self {
            normal_radius_m: None,
            normal_diameter_m: None,
            cylinder_radius_m: None,
            cylinder_diameter_m: None,
            max_depth_m: params.max_depth_m,
            core_spacing_m: params.core_spacing_m,
            robust: params.robust,
            min_points: params.min_points,
            ddof: params.ddof,
            registration_error_m: params.registration_error_m,
        }
    }
}

impl TryFrom<Keys> for M3c2Params {
    type Error = ParamError;

    fn try_from(keys: Keys) -> Result<Self, ParamError> {
        let default = Self::default();
        let normal = radius_of("normal", keys.normal_radius_m, keys.normal_diameter_m)?;
        let cylinder = radius_of("cylinder", keys.cylinder_radius_m, keys.cylinder_diameter_m)?;
        Ok(Self {
            normal_radius_m: normal.unwrap_or(default.normal_radius_m),
            cylinder_radius_m: cylinder.unwrap_or(default.cylinder_radius_m),
            max_depth_m: keys.max_depth_m,
            core_spacing_m: keys.core_spacing_m,
            robust: keys.robust,
            min_points: keys.min_points,
            ddof: keys.ddof,
            registration_error_m: keys.registration_error_m,
        })
    }
}

fn radius_of(scale: &str, radius: Option<f64>, diameter: Option<f64>) -> Result<Option<f64>, ParamError> {
    match (radius, diameter) {
        (Some(_), Some(diameter)) => Err(ParamError::new(
            format!("{scale}_diameter_m"),
            diameter,
            format!("left out where {scale}_radius_m is given"),
        )),
        (None, Some(diameter)) => Ok(Some(0.5 * diameter)),
        (radius, None) => Ok(radius),
    }
}

/// The schema with the diameters that may be given in place of radii.
fn with_diameters(schema: &mut Schema) {
    let Some(properties) = schema.get_mut("properties").and_then(Value::as_object_mut) else {
        return;
    };
    for scale in ["normal", "cylinder"] {
        let radius = format!("{scale}_radius_m");
        let Some(mut diameter) = properties.get(&radius).cloned() else {
            continue;
        };
        if let Some(keys) = diameter.as_object_mut() {
            keys.remove("default");
            let description = format!("Twice `{radius}`, metres; may be given in its place.");
            keys.insert("description".to_owned(), json!(description));
        }
        properties.insert(format!("{scale}_diameter_m"), diameter);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(json: &str) -> Result<M3c2Params, String> {
        serde_json::from_str(json).map_err(|e| e.to_string())
    }

    #[test]
    fn radius_and_diameter_mean_the_same_cylinder() {
        let radius = read(r#"{"cylinder_radius_m": 0.1, "normal_radius_m": 0.3}"#).unwrap();
        let diameter = read(r#"{"cylinder_diameter_m": 0.2, "normal_diameter_m": 0.6}"#).unwrap();
        assert_eq!(radius, diameter);
        assert_eq!(read("{}").unwrap(), M3c2Params::default());
    }

    #[test]
    fn wrong_keys_are_named() {
        let both = read(r#"{"cylinder_radius_m": 0.1, "cylinder_diameter_m": 0.2}"#).unwrap_err();
        assert!(
            both.contains("left out where cylinder_radius_m is given"),
            "{both}"
        );
        assert!(
            read(r#"{"normal_scale": 1}"#)
                .unwrap_err()
                .contains("normal_scale")
        );
    }

    #[test]
    fn parameters_survive_writing_and_reading() {
        let params = M3c2Params {
            cylinder_radius_m: 0.07,
            robust: true,
            ..M3c2Params::default()
        };
        assert_eq!(read(&serde_json::to_string(&params).unwrap()).unwrap(), params);
    }
}

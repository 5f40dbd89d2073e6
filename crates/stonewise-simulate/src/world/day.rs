//! What differs between the epochs beside motion: light, moss, moisture.

use crate::world::light::Light;
use crate::world::noise::Noise;
use serde::{Deserialize, Serialize};

/// What the wall looks like on one day.
#[derive(Clone, Debug)]
pub struct Day {
    /// Seed of what differs by chance.
    pub seed: u64,
    /// Light of the day.
    pub light: Light,
    /// Moss: 1 is usual, 0.7 and 1.3 are the least and the most that chance gives.
    pub moss: f64,
    /// Moisture: 0 is dry, 0.5 the most that chance gives.
    pub wet: f64,
}

/// How the days of the later epochs differ from that of the first.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LaterDays {
    /// Their light.
    pub light: LaterLight,
    /// Moss beyond that of the first epoch; by chance where nothing is stated.
    pub moss_change: Option<f64>,
    /// Moisture beyond that of the first epoch; by chance where nothing is stated.
    pub wet_change: Option<f64>,
}

/// Light of the later epochs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LaterLight {
    /// By chance, as that of the first epoch.
    #[default]
    Other,
    /// The light of the first epoch.
    Same,
    /// The sky alone.
    Overcast,
}

impl Day {
    /// A day of which everything is by chance.
    pub fn new(seed: u64) -> Self {
        let draw = Noise::new(seed, 60);
        Self {
            seed,
            light: Light::of_day(seed),
            moss: 0.7 + 0.6 * draw.uniform(0),
            wet: 0.5 * draw.uniform(1),
        }
    }

    /// The day of a later epoch. `first`: seed of the first epoch's day.
    pub fn later(seed: u64, first: u64, params: &LaterDays) -> Self {
        let (by_chance, first) = (Self::new(seed), Self::new(first));
        Self {
            seed,
            light: match params.light {
                LaterLight::Other => by_chance.light,
                LaterLight::Same => first.light,
                LaterLight::Overcast => first.light.overcast(),
            },
            moss: params
                .moss_change
                .map_or(by_chance.moss, |change| first.moss + change),
            wet: params
                .wet_change
                .map_or(by_chance.wet, |change| first.wet + change),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn a_later_day_differs_only_by_what_is_stated() {
        let first = Day::new(7);
        let stated = LaterDays {
            light: LaterLight::Same,
            moss_change: Some(0.2),
            wet_change: Some(0.0),
        };
        let later = Day::later(8, 7, &stated);
        assert_eq!(later.seed, 8);
        assert_eq!((later.moss, later.wet), (first.moss + 0.2, first.wet));
        assert_eq!(later.light.sun, first.light.sun);
        let by_chance = Day::later(8, 7, &LaterDays::default());
        assert_eq!(
            (by_chance.moss, by_chance.wet),
            (Day::new(8).moss, Day::new(8).wet)
        );
        assert_ne!(by_chance.light.sun, first.light.sun);
    }

    #[test]
    fn without_sun_light_does_not_depend_on_shadows() {
        let overcast = LaterDays {
            light: LaterLight::Overcast,
            ..LaterDays::default()
        };
        let light = Day::later(8, 7, &overcast).light;
        let normal = Vector3::new(0.9, 0.1, 0.2).normalize();
        assert_eq!(light.on(&normal, 0.0, 1.0), light.on(&normal, 1.0, 1.0));
        assert!(light.on(&normal, 0.0, 1.0)[0] > 0.1);
    }
}

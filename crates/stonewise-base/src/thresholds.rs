//! `[thresholds]` of the project file: which motions call for attention, and which for an alarm.

use nalgebra::Point2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use stonewise_core::params::{ParamError, Params, Range, Ranged, with_ranges};

/// The thresholds of a project; nothing is given by default.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "Keys", into = "Keys")]
pub struct Thresholds {
    /// Thresholds of the wall.
    pub wall: Measures,
    /// Of the largest deformation of a zone; those of lengths of motions where it has none of its own.
    pub deformation: Levels,
    /// Parts of the wall with thresholds of their own.
    pub zones: Vec<Zone>,
}

/// Thresholds of everything that is judged.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measures {
    /// Of the length of a stone's motion.
    pub length: Levels,
    /// Of the length of its motion against its neighbours.
    pub neighbours: Levels,
    /// Of the opening of a joint.
    pub joints: Levels,
}

/// Two thresholds of one quantity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = with_ranges::<Levels>)]
pub struct Levels {
    /// From here on attention is called for, millimetres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attention_mm: Option<f64>,
    /// From here on an alarm is raised, millimetres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub alarm_mm: Option<f64>,
}

/// A part of the wall.
#[derive(Clone, Debug, PartialEq)]
pub struct Zone {
    /// Name, as the verdict shows it.
    pub name: String,
    /// Corners (along, up) in the facade frame, metres, as in `along_m` and `up_m` of the stone table; the
    /// last is joined to the first.
    pub polygon: Vec<[f64; 2]>,
    /// Its thresholds; those of the wall where it has none of its own.
    pub measures: Measures,
}

/// The table as files spell it.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = with_ranges::<Thresholds>)]
struct Keys {
    /// From this length of a stone's motion on attention is called for, millimetres. Absent: the alarm's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    attention_mm: Option<f64>,
    /// From this length of a stone's motion on an alarm is raised, millimetres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    alarm_mm: Option<f64>,
    /// From this deformation of a zone on attention is called for, millimetres. Absent: the alarm's; where neither is
    /// given, the thresholds of the length of a motion hold.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    deformation_attention_mm: Option<f64>,
    /// From this deformation of a zone on an alarm is raised, millimetres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    deformation_alarm_mm: Option<f64>,
    /// Thresholds of the motion of a stone against its neighbours.
    #[serde(default, skip_serializing_if = "Levels::is_empty")]
    neighbours: Levels,
    /// Thresholds of the opening of a joint between two stones.
    #[serde(default, skip_serializing_if = "Levels::is_empty")]
    joints: Levels,
    /// Parts of the wall with thresholds of their own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    zones: Vec<ZoneKeys>,
}

/// A part of the wall, as files spell it.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = with_ranges::<Levels>)]
struct ZoneKeys {
    /// Name, as the verdict shows it.
    name: String,
    /// Corners [along, up] in the facade frame, metres: `along_m` and `up_m` of stones.csv.
    polygon: Vec<[f64; 2]>,
    /// From this length of a stone's motion on attention is called for, millimetres. Absent: the alarm's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    attention_mm: Option<f64>,
    /// From this length of a stone's motion on an alarm is raised, millimetres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    alarm_mm: Option<f64>,
    /// Thresholds of the motion of a stone against its neighbours.
    #[serde(default, skip_serializing_if = "Levels::is_empty")]
    neighbours: Levels,
    /// Thresholds of the opening of a joint between two stones.
    #[serde(default, skip_serializing_if = "Levels::is_empty")]
    joints: Levels,
}

impl Levels {
    /// Whether neither threshold is given.
    pub fn is_empty(&self) -> bool {
        self.attention_mm.is_none() && self.alarm_mm.is_none()
    }

    /// Where attention begins, metres: at the alarm where no threshold of attention is given.
    pub fn attention_m(&self) -> Option<f64> {
        self.attention_mm.or(self.alarm_mm).map(|mm| mm / 1e3)
    }

    /// Where an alarm begins, metres.
    pub fn alarm_m(&self) -> Option<f64> {
        self.alarm_mm.map(|mm| mm / 1e3)
    }

    fn or(self, other: Self) -> Self {
        if self.is_empty() { other } else { self }
    }
}

impl Params for Levels {
    fn ranges(&self) -> Vec<Ranged> {
        vec![
            Range::POSITIVE.holds("attention_mm", self.attention_mm),
            Range::POSITIVE.holds("alarm_mm", self.alarm_mm),
        ]
    }

    fn check_relations(&self) -> Result<(), ParamError> {
        match (self.attention_mm, self.alarm_mm) {
            (Some(attention), Some(alarm)) if attention >= alarm => Err(ParamError::new(
                "attention_mm",
                attention,
                format!("below alarm_mm = {alarm}: attention comes before the alarm"),
            )),
            _ => Ok(()),
        }
    }
}

impl Measures {
    /// Whether no threshold is given.
    pub fn is_empty(&self) -> bool {
        self.length.is_empty() && self.neighbours.is_empty() && self.joints.is_empty()
    }

    fn or(self, other: Self) -> Self {
        Self {
            length: self.length.or(other.length),
            neighbours: self.neighbours.or(other.neighbours),
            joints: self.joints.or(other.joints),
        }
    }
}

impl Params for Measures {
    fn ranges(&self) -> Vec<Ranged> {
        self.length.ranges()
    }

    fn check_relations(&self) -> Result<(), ParamError> {
        self.length.check_relations()
    }

    fn parts(&self) -> Vec<(&'static str, &dyn Params)> {
        vec![("neighbours", &self.neighbours), ("joints", &self.joints)]
    }
}

impl Params for Thresholds {
    fn ranges(&self) -> Vec<Ranged> {
        let mut ranges = self.wall.ranges();
        ranges.extend([
            Range::POSITIVE.holds("deformation_attention_mm", self.deformation.attention_mm),
            Range::POSITIVE.holds("deformation_alarm_mm", self.deformation.alarm_mm),
        ]);
        ranges
    }

    fn check_relations(&self) -> Result<(), ParamError> {
        self.wall.check()?;
        self.deformation.check_relations().map_err(|error| ParamError {
            key: format!("deformation_{}", error.key),
            ..error
        })?;
        for (number, zone) in self.zones.iter().enumerate() {
            let checked = zone.measures.check();
            checked.map_err(|error| error.within(&format!("zones.{number}")))?;
        }
        Ok(())
    }
}

impl Zone {
    /// Whether a place (along, up) of the facade lies in the zone (even-odd rule).
    pub fn contains(&self, place: &Point2<f64>) -> bool {
        let edges = self.polygon.iter().zip(self.polygon.iter().cycle().skip(1));
        let crossings = edges.filter(|(a, b)| {
            (a[1] > place.y) != (b[1] > place.y)
                && place.x < a[0] + (place.y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
        });
        crossings.count() % 2 == 1
    }
}

impl Thresholds {
    /// Whether no threshold is given at all.
    pub fn is_empty(&self) -> bool {
        self.wall.is_empty()
            && self.deformation.is_empty()
            && self.zones.iter().all(|z| z.measures.is_empty())
    }

    /// The thresholds of a deformation.
    pub fn of_deformation(&self) -> Levels {
        self.deformation.or(self.wall.length)
    }

    /// The first zone that holds a place (along, up) of the facade.
    pub fn zone_at(&self, place: &Point2<f64>) -> Option<usize> {
        self.zones.iter().position(|zone| zone.contains(place))
    }

    /// The thresholds in a zone, or of the wall outside all zones.
    pub fn measures(&self, zone: Option<usize>) -> Measures {
        zone.and_then(|i| self.zones.get(i))
            .map_or(self.wall, |zone| zone.measures)
    }
}

impl TryFrom<Keys> for Thresholds {
    type Error = String;

    fn try_from(keys: Keys) -> Result<Self, String> {
        let wall = Measures {
            length: Levels {
                attention_mm: keys.attention_mm,
                alarm_mm: keys.alarm_mm,
            },
            neighbours: keys.neighbours,
            joints: keys.joints,
        };
        let mut zones: Vec<Zone> = Vec::new();
        for keys in keys.zones {
            let name = keys.name.trim();
            if name.is_empty() || zones.iter().any(|z| z.name == name) {
                return Err(format!(
                    "name = {name:?} in [[thresholds.zones]]: give each zone a name of its own"
                ));
            }
            zones.push(zone(keys, &wall)?);
        }
        let deformation = Levels {
            attention_mm: keys.deformation_attention_mm,
            alarm_mm: keys.deformation_alarm_mm,
        };
        Ok(Self {
            wall,
            deformation,
            zones,
        })
    }
}

fn zone(keys: ZoneKeys, wall: &Measures) -> Result<Zone, String> {
    let name = keys.name.trim().to_owned();
    if keys.polygon.len() < 3 || keys.polygon.iter().flatten().any(|v| !v.is_finite()) {
        return Err(format!(
            "polygon of zone {name:?} of [thresholds] needs three corners [along, up] at least, metres in the facade frame"
        ));
    }
    let own = Measures {
        length: Levels {
            attention_mm: keys.attention_mm,
            alarm_mm: keys.alarm_mm,
        },
        neighbours: keys.neighbours,
        joints: keys.joints,
    };
    Ok(Zone {
        name,
        polygon: keys.polygon,
        measures: own.or(*wall),
    })
}

impl From<Thresholds> for Keys {
    fn from(thresholds: Thresholds) -> Self {
        let zone = |zone: Zone| ZoneKeys {
            name: zone.name,
            polygon: zone.polygon,
            attention_mm: zone.measures.length.attention_mm,
            alarm_mm: zone.measures.length.alarm_mm,
            neighbours: zone.measures.neighbours,
            joints: zone.measures.joints,
        };
        Self {
            attention_mm: thresholds.wall.length.attention_mm,
            alarm_mm: thresholds.wall.length.alarm_mm,
            deformation_attention_mm: thresholds.deformation.attention_mm,
            deformation_alarm_mm: thresholds.deformation.alarm_mm,
            neighbours: thresholds.wall.neighbours,
            joints: thresholds.wall.joints,
            zones: thresholds.zones.into_iter().map(zone).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Thresholds, String> {
        let thresholds: Thresholds = toml::from_str(text).map_err(|e| e.message().to_owned())?;
        thresholds.check().map_err(|e| e.to_string())?;
        Ok(thresholds)
    }

    const FULL: &str = "attention_mm = 5\nalarm_mm = 10.0\ndeformation_attention_mm = 1.0\nneighbours = { attention_mm = 2.0, alarm_mm = 4.0 }\n\
        [[zones]]\nname = \"crest\"\npolygon = [[0.0, 8.0], [9.0, 8.0], [9.0, 10.0], [0.0, 10.0]]\nalarm_mm = 3.0\n";

    #[test]
    fn zones_have_their_own_thresholds_and_take_the_rest_from_the_wall() {
        let thresholds = read(FULL).unwrap();
        assert_eq!(thresholds.wall.length.attention_m(), Some(0.005));
        let crest = thresholds.zone_at(&Point2::new(4.0, 9.0));
        assert_eq!(crest, Some(0));
        assert_eq!(thresholds.zone_at(&Point2::new(4.0, 7.9)), None);
        let measures = thresholds.measures(crest);
        assert_eq!(
            (measures.length.attention_m(), measures.length.alarm_m()),
            (Some(0.003), Some(0.003))
        );
        assert_eq!(measures.neighbours.alarm_mm, Some(4.0));
        assert!(measures.joints.is_empty());
        assert_eq!(thresholds.of_deformation().attention_mm, Some(1.0));
        let length = read("alarm_mm = 4.0").unwrap();
        assert_eq!(length.of_deformation().alarm_mm, Some(4.0));
        assert!(read("").unwrap().is_empty() && !thresholds.is_empty());
    }

    #[test]
    fn they_come_back_from_a_record_as_they_were() {
        for thresholds in [read(FULL).unwrap(), Thresholds::default()] {
            let text = serde_json::to_string(&thresholds).unwrap();
            assert_eq!(serde_json::from_str::<Thresholds>(&text).unwrap(), thresholds);
        }
        assert_eq!(serde_json::to_string(&Thresholds::default()).unwrap(), "{}");
    }

    #[test]
    fn impossible_thresholds_name_the_key_and_the_fix() {
        for (text, words) in [
            (
                "attention_mm = 10.0\nalarm_mm = 5.0",
                "attention_mm = 10 is not possible: it must be below alarm_mm = 5",
            ),
            ("attention_mm = 5.0\nalarm_mm = 5.0", "must be below"),
            (
                "deformation_attention_mm = 2.0\ndeformation_alarm_mm = 1.0",
                "deformation_attention_mm = 2 is not possible: it must be below",
            ),
            (
                "deformation_alarm_mm = -1.0",
                "deformation_alarm_mm = -1 is not possible",
            ),
            (
                "alarm_mm = 0.0",
                "alarm_mm = 0 is not possible: it must be above 0",
            ),
            ("attention_mm = nan", "a finite number, above 0"),
            (
                "joints = { attention_mm = -1.0 }",
                "joints.attention_mm = -1 is not possible",
            ),
            (
                "[[zones]]\nname = \"a\"\npolygon = [[0, 0], [1, 0], [1, 1]]\nneighbours = { alarm_mm = inf }",
                "zones.0.neighbours.alarm_mm = inf",
            ),
            ("alarm = 5.0", "unknown field `alarm`"),
            (
                "[[zones]]\nname = \"a\"\npolygon = [[0.0, 0.0], [1.0, 0.0]]",
                "three corners",
            ),
            ("[[zones]]\nname = \" \"\npolygon = []", "a name of its own"),
        ] {
            let message = read(text).unwrap_err();
            assert!(message.contains(words), "{text}: {message}");
        }
    }
}

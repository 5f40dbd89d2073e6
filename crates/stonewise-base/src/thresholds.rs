//! `[thresholds]` of the project file: which motions call for attention, and which for an alarm.

use nalgebra::Point2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use stonewise_core::params::{Numbers, ParamError, Params, Range, Ranged, with_ranges};

/// What is compared with thresholds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// The length of a stone's motion, millimetres.
    Length,
    /// A stone's motion out of the face, millimetres.
    Out,
    /// A stone's motion up the face, millimetres.
    Up,
    /// A stone's motion along the wall, millimetres.
    Along,
    /// The length of a stone's motion against its neighbours, millimetres.
    Neighbours,
    /// The opening of a joint, millimetres.
    Joints,
    /// The largest deformation of a zone, millimetres.
    Deformation,
    /// The length of a stone's velocity, millimetres a year.
    Rate,
    /// The departure of a stone's newest epoch from what the model of a series predicts, standard deviations.
    Departure,
}

impl Quantity {
    /// Every quantity, in the order in which reasons name them.
    pub const ALL: [Self; 9] = [
        Self::Length,
        Self::Out,
        Self::Up,
        Self::Along,
        Self::Neighbours,
        Self::Joints,
        Self::Deformation,
        Self::Rate,
        Self::Departure,
    ];

    /// The word in files.
    pub fn word(self) -> &'static str {
        match self {
            Self::Length => "length",
            Self::Out => "out",
            Self::Up => "up",
            Self::Along => "along",
            Self::Neighbours => "neighbours",
            Self::Joints => "joints",
            Self::Deformation => "deformation",
            Self::Rate => "rate",
            Self::Departure => "departure",
        }
    }
}

/// How serious it is to be beyond a threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// It calls for attention.
    Attention,
    /// It is an alarm.
    Alarm,
}

/// A limit of a quantity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Threshold {
    /// What is limited.
    pub quantity: Quantity,
    /// What follows beyond the limit.
    pub level: Level,
    /// The limit in the unit of the quantity: an upper one where it is positive, a lower one where it is negative.
    pub limit: f64,
}

/// The thresholds of a project; nothing is given by default.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "Keys", into = "Keys")]
pub struct Thresholds {
    keys: Keys,
    wall: Vec<Threshold>,
    zones: Vec<Zone>,
}

/// A part of the wall.
#[derive(Clone, Debug, PartialEq)]
pub struct Zone {
    /// Name, as the verdict shows it.
    pub name: String,
    /// Corners (along, up) in the facade frame, metres, as in `along_m` and `up_m` of the stone table; the
    /// last is joined to the first.
    pub polygon: Vec<[f64; 2]>,
    /// Its thresholds, and those of the wall for quantities of which it has none.
    thresholds: Vec<Threshold>,
}

/// Two thresholds of one quantity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = with_ranges::<Levels>)]
struct Levels {
    /// From here on attention is called for, millimetres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    attention_mm: Option<f64>,
    /// From here on an alarm is raised, millimetres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    alarm_mm: Option<f64>,
}

/// The limits of a quantity in two fields of a table.
macro_rules! pair {
    ($table:ident, $quantity:ident, $attention:ident, $alarm:ident) => {
        Pair {
            quantity: Quantity::$quantity,
            limits: [
                (stringify!($attention), $table.$attention.numbers()),
                (stringify!($alarm), $table.$alarm.numbers()),
            ],
        }
    };
}

/// A table as files spell it: keys of its own, and those of the thresholds.
macro_rules! table {
    ($(#[$of_table:meta])* $name:ident { $($own:tt)* }) => {
        $(#[$of_table])*
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields)]
        #[schemars(transform = with_ranges::<$name>)]
        struct $name {
            /// From this length of a stone's motion on attention is called for, millimetres. Absent: the alarm's.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            attention_mm: Option<f64>,
            /// From this length of a stone's motion on an alarm is raised, millimetres.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            alarm_mm: Option<f64>,
            /// Below the first (negative) or above the second (positive) motion of a stone out of the face attention is
            /// called for, millimetres.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            out_attention_mm: Option<[f64; 2]>,
            /// Below the first or above the second motion of a stone out of the face an alarm is raised, millimetres.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            out_alarm_mm: Option<[f64; 2]>,
            /// As `out_attention_mm`, of the motion up the face, millimetres.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            up_attention_mm: Option<[f64; 2]>,
            /// As `out_alarm_mm`, of the motion up the face, millimetres.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            up_alarm_mm: Option<[f64; 2]>,
            /// As `out_attention_mm`, of the motion along the wall, millimetres.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            along_attention_mm: Option<[f64; 2]>,
            /// As `out_alarm_mm`, of the motion along the wall, millimetres.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            along_alarm_mm: Option<[f64; 2]>,
            /// Thresholds of the motion of a stone against its neighbours.
            #[serde(default, skip_serializing_if = "Levels::is_empty")]
            neighbours: Levels,
            /// Thresholds of the opening of a joint between two stones.
            #[serde(default, skip_serializing_if = "Levels::is_empty")]
            joints: Levels,
            /// From this deformation of a zone on attention is called for, millimetres. Absent: the alarm's; where neither
            /// is given, the thresholds of the length of a motion hold.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            deformation_attention_mm: Option<f64>,
            /// From this deformation of a zone on an alarm is raised, millimetres.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            deformation_alarm_mm: Option<f64>,
            /// From this velocity of a stone on attention is called for, millimetres a year. Absent: the alarm's.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            rate_attention_mm_per_year: Option<f64>,
            /// From this velocity of a stone on an alarm is raised, millimetres a year.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            rate_alarm_mm_per_year: Option<f64>,
            /// From this departure of the newest epoch from what the model of the series predicts on attention is called
            /// for, standard deviations. Absent: the alarm's.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            departure_attention_sd: Option<f64>,
            /// From this departure of the newest epoch from the model on an alarm is raised, standard deviations.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            departure_alarm_sd: Option<f64>,
            $($own)*
        }

        impl $name {
            fn pairs(&self) -> [Pair; 7] {
                [
                    pair!(self, Length, attention_mm, alarm_mm),
                    pair!(self, Out, out_attention_mm, out_alarm_mm),
                    pair!(self, Up, up_attention_mm, up_alarm_mm),
                    pair!(self, Along, along_attention_mm, along_alarm_mm),
                    pair!(self, Deformation, deformation_attention_mm, deformation_alarm_mm),
                    pair!(self, Rate, rate_attention_mm_per_year, rate_alarm_mm_per_year),
                    pair!(self, Departure, departure_attention_sd, departure_alarm_sd),
                ]
            }

            fn thresholds(&self) -> Vec<Threshold> {
                let levels = [
                    self.neighbours.pair(Quantity::Neighbours),
                    self.joints.pair(Quantity::Joints),
                ];
                self.pairs().iter().chain(&levels).flat_map(Pair::thresholds).collect()
            }
        }

        impl Params for $name {
            fn ranges(&self) -> Vec<Ranged> {
                self.pairs().iter().flat_map(Pair::ranges).collect()
            }

            fn check_relations(&self) -> Result<(), ParamError> {
                self.pairs().iter().try_for_each(Pair::check)
            }

            fn parts(&self) -> Vec<(&'static str, &dyn Params)> {
                vec![("neighbours", &self.neighbours), ("joints", &self.joints)]
            }
        }
    };
}

table! {
    /// The table as files spell it.
    Keys {
        /// Parts of the wall with thresholds of their own.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        zones: Vec<ZoneKeys>,
    }
}

table! {
    /// A part of the wall, as files spell it.
    ZoneKeys {
        /// Name, as the verdict shows it.
        name: String,
        /// Corners [along, up] in the facade frame, metres: `along_m` and `up_m` of stones.csv.
        polygon: Vec<[f64; 2]>,
    }
}

/// The limits of a quantity by their keys: of attention, of an alarm. A quantity with a sign has a lower and an upper one.
struct Pair {
    quantity: Quantity,
    limits: [(&'static str, Vec<f64>); 2],
}

impl Pair {
    fn is_signed(&self) -> bool {
        matches!(self.quantity, Quantity::Out | Quantity::Up | Quantity::Along)
    }

    fn ranges(&self) -> Vec<Ranged> {
        let unsigned = self.limits.iter().filter(|_| !self.is_signed());
        unsigned
            .map(|(key, limits)| Range::POSITIVE.holds(key, limits.as_slice()))
            .collect()
    }

    fn check(&self) -> Result<(), ParamError> {
        let error =
            |key, limits: &[f64], allowed: String| Err(ParamError::new(key, written(limits), allowed));
        for (key, limits) in &self.limits {
            let is_sound = |[lower, upper]: [f64; 2]| {
                lower.is_finite() && upper.is_finite() && lower < 0.0 && upper > 0.0
            };
            if let [lower, upper] = limits[..]
                && !is_sound([lower, upper])
            {
                let allowed =
                    "[lower limit below 0, upper limit above 0]: a stone that stands still lies between them";
                return error(*key, limits, allowed.to_owned());
            }
        }
        let [(key, attention), (alarm_key, alarm)] = &self.limits;
        let is_inside = alarm
            .iter()
            .zip(attention)
            .any(|(alarm, attention)| alarm.abs() < attention.abs());
        if is_inside || (!alarm.is_empty() && alarm == attention) {
            let side = if self.is_signed() { "inside" } else { "below" };
            let alarm = written(alarm);
            return error(
                *key,
                attention,
                format!("{side} {alarm_key} = {alarm}: attention must be reached before the alarm"),
            );
        }
        Ok(())
    }

    fn thresholds(&self) -> impl Iterator<Item = Threshold> {
        let quantity = self.quantity;
        let levels = self.limits.iter().zip([Level::Attention, Level::Alarm]);
        levels.flat_map(move |((_, limits), level)| {
            limits.iter().map(move |limit| Threshold {
                quantity,
                level,
                limit: *limit,
            })
        })
    }
}

/// Limits as the project file spells them.
fn written(limits: &[f64]) -> String {
    match limits {
        [only] => only.to_string(),
        _ => format!("{limits:?}"),
    }
}

impl Levels {
    fn is_empty(&self) -> bool {
        self.attention_mm.is_none() && self.alarm_mm.is_none()
    }

    fn pair(&self, quantity: Quantity) -> Pair {
        Pair {
            quantity,
            ..pair!(self, Length, attention_mm, alarm_mm)
        }
    }
}

impl Params for Levels {
    fn ranges(&self) -> Vec<Ranged> {
        self.pair(Quantity::Length).ranges()
    }

    fn check_relations(&self) -> Result<(), ParamError> {
        self.pair(Quantity::Length).check()
    }
}

impl Params for Thresholds {
    fn check(&self) -> Result<(), ParamError> {
        self.keys.check()?;
        for (number, zone) in self.keys.zones.iter().enumerate() {
            let checked = zone.check();
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
        self.wall.is_empty() && self.zones.iter().all(|z| z.thresholds.is_empty())
    }

    /// Parts of the wall with thresholds of their own.
    pub fn zones(&self) -> &[Zone] {
        &self.zones
    }

    /// The first zone that holds a place (along, up) of the facade.
    pub fn zone_at(&self, place: &Point2<f64>) -> Option<usize> {
        self.zones.iter().position(|zone| zone.contains(place))
    }

    /// The thresholds of a quantity in a zone, or of the wall outside all zones. Where deformations have none, those of
    /// the length of a motion hold.
    pub fn of(&self, quantity: Quantity, zone: Option<usize>) -> impl Iterator<Item = Threshold> + Clone {
        let zone = zone.and_then(|i| self.zones.get(i));
        let all = zone.map_or(&self.wall, |zone| &zone.thresholds);
        let is_given = all.iter().any(|t| t.quantity == quantity);
        let quantity = match quantity {
            Quantity::Deformation if !is_given => Quantity::Length,
            given => given,
        };
        all.iter().copied().filter(move |t| t.quantity == quantity)
    }

    /// The farthest alarm threshold of motions of stones, metres, where colour scales end; that of the wall.
    pub fn farthest_alarm_m(&self) -> Option<f64> {
        let motions = [Quantity::Length, Quantity::Out, Quantity::Up, Quantity::Along];
        let all = motions.into_iter().flat_map(|quantity| self.of(quantity, None));
        let alarms = all.filter(|t| t.level == Level::Alarm);
        alarms.map(|t| t.limit.abs() / 1e3).reduce(f64::max)
    }

    /// Whether a quantity has thresholds anywhere on the wall.
    pub fn has(&self, quantity: Quantity) -> bool {
        let zones = (0..self.zones.len()).map(Some);
        zones
            .chain([None])
            .any(|zone| self.of(quantity, zone).next().is_some())
    }
}

impl TryFrom<Keys> for Thresholds {
    type Error = String;

    fn try_from(keys: Keys) -> Result<Self, String> {
        let wall: Vec<Threshold> = keys.thresholds();
        let mut zones: Vec<Zone> = Vec::new();
        for keys in &keys.zones {
            let name = keys.name.trim();
            if name.is_empty() || zones.iter().any(|z| z.name == name) {
                return Err(format!(
                    "name = {name:?} in [[thresholds.zones]]: give each zone a name of its own"
                ));
            }
            zones.push(zone(keys, &wall)?);
        }
        Ok(Self { keys, wall, zones })
    }
}

fn zone(keys: &ZoneKeys, wall: &[Threshold]) -> Result<Zone, String> {
    let name = keys.name.trim().to_owned();
    if keys.polygon.len() < 3 || keys.polygon.iter().flatten().any(|v| !v.is_finite()) {
        return Err(format!(
            "polygon of zone {name:?} of [thresholds] needs three corners [along, up] at least, metres in the facade frame"
        ));
    }
    let mut thresholds: Vec<Threshold> = keys.thresholds();
    let has_own = |quantity| thresholds.iter().any(|t| t.quantity == quantity);
    let rest: Vec<Threshold> = wall.iter().copied().filter(|t| !has_own(t.quantity)).collect();
    thresholds.extend(rest);
    Ok(Zone {
        name,
        polygon: keys.polygon.clone(),
        thresholds,
    })
}

impl From<Thresholds> for Keys {
    fn from(thresholds: Thresholds) -> Self {
        thresholds.keys
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

    fn limits(thresholds: &Thresholds, quantity: Quantity, zone: Option<usize>) -> Vec<(Level, f64)> {
        thresholds
            .of(quantity, zone)
            .map(|t| (t.level, t.limit))
            .collect()
    }

    const FULL: &str = "attention_mm = 5\nalarm_mm = 10.0\nout_attention_mm = [-5, 10.0]\nout_alarm_mm = [-5, 20]\n\
        deformation_attention_mm = 1.0\nneighbours = { attention_mm = 2.0, alarm_mm = 4.0 }\nrate_alarm_mm_per_year = 3\n\
        [[zones]]\nname = \"crest\"\npolygon = [[0.0, 8.0], [9.0, 8.0], [9.0, 10.0], [0.0, 10.0]]\nalarm_mm = 3.0\n\
        departure_attention_sd = 3.0\n";

    #[test]
    fn zones_have_their_own_thresholds_and_take_the_rest_from_the_wall() {
        use Level::{Alarm, Attention};
        let thresholds = read(FULL).unwrap();
        let of = |quantity, zone| limits(&thresholds, quantity, zone);
        assert_eq!(of(Quantity::Length, None), [(Attention, 5.0), (Alarm, 10.0)]);
        let crest = thresholds.zone_at(&Point2::new(4.0, 9.0));
        assert_eq!(crest, Some(0));
        assert_eq!(thresholds.zone_at(&Point2::new(4.0, 7.9)), None);
        assert_eq!(of(Quantity::Length, crest), [(Alarm, 3.0)]);
        assert_eq!(of(Quantity::Neighbours, crest), [(Attention, 2.0), (Alarm, 4.0)]);
        let out = [(Attention, -5.0), (Attention, 10.0), (Alarm, -5.0), (Alarm, 20.0)];
        assert_eq!(of(Quantity::Out, crest), out);
        assert_eq!(of(Quantity::Departure, crest), [(Attention, 3.0)]);
        assert_eq!(of(Quantity::Departure, None), []);
        assert!(thresholds.has(Quantity::Departure) && !thresholds.has(Quantity::Joints));
        assert_eq!(of(Quantity::Deformation, None), [(Attention, 1.0)]);
        assert_eq!(thresholds.farthest_alarm_m(), Some(0.02));
        assert_eq!(read("attention_mm = 5").unwrap().farthest_alarm_m(), None);
        let length = read("alarm_mm = 4.0").unwrap();
        assert_eq!(limits(&length, Quantity::Deformation, None), [(Alarm, 4.0)]);
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
                "out_attention_mm = [-5, 10]\nout_alarm_mm = [-4, 20]",
                "out_attention_mm = [-5.0, 10.0] is not possible: it must be inside out_alarm_mm = [-4.0, 20.0]",
            ),
            (
                "up_attention_mm = [-5, 5]\nup_alarm_mm = [-5, 5]",
                "must be inside",
            ),
            (
                "along_alarm_mm = [10, -5]",
                "along_alarm_mm = [10.0, -5.0] is not possible: it must be [lower limit below 0, upper limit above 0]",
            ),
            ("along_alarm_mm = [2, 5]", "lower limit below 0"),
            ("along_alarm_mm = [-2, inf]", "lower limit below 0"),
            ("out_alarm_mm = 5.0", "invalid type"),
            (
                "rate_attention_mm_per_year = 2\nrate_alarm_mm_per_year = 1",
                "must be below rate_alarm_mm_per_year = 1",
            ),
            ("departure_alarm_sd = 0", "must be above 0"),
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

//! Areas that did not move between the epochs, as the project file names them.

use crate::messages::Said;
use crate::messages::notices::{NAMED_AREA, NUMBERED_AREA};
use nalgebra::Point3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use stonewise_core::geometry::Bounds;

/// A stable area: a box, or a polygon seen from above with a range of heights. World frame, metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "Keys", into = "Keys")]
pub struct StableArea(Keys);

/// The area as files spell it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Keys {
    /// What people call it; it may be absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    /// Two opposite corners.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    corners: Option<[[f64; 3]; 2]>,
    /// Corners x, y; the last is joined to the first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    polygon: Option<Vec<[f64; 2]>>,
    /// Lowest and highest z of the polygon.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    z: Option<[f64; 2]>,
}

impl TryFrom<Keys> for StableArea {
    type Error = String;

    fn try_from(keys: Keys) -> Result<Self, String> {
        match (&keys.corners, &keys.polygon, &keys.z) {
            (Some([a, b]), None, None) => {
                if !(0..3).all(|i| (a[i] - b[i]).abs() > 0.0 && a[i].is_finite() && b[i].is_finite()) {
                    return Err("a stable box needs two opposite corners that differ in x, y and z".into());
                }
            }
            (None, Some(ring), Some([low, high])) => {
                if ring.len() < 3 || ring.iter().flatten().any(|v| !v.is_finite()) {
                    return Err("a stable polygon needs three corners [x, y] at least".into());
                }
                if !(low.is_finite() && high.is_finite() && low < high) {
                    return Err(format!(
                        "z = [{low}, {high}] of a stable polygon must be [lowest, highest]"
                    ));
                }
            }
            _ => {
                return Err(
                    "a stable area is either a box, corners = [[x, y, z], [x, y, z]], or a polygon seen from above, \
                     polygon = [[x, y], ...] with z = [lowest, highest]"
                        .into(),
                );
            }
        }
        Ok(Self(keys))
    }
}

impl From<StableArea> for Keys {
    fn from(area: StableArea) -> Self {
        area.0
    }
}

impl StableArea {
    /// What people call it.
    pub fn name(&self) -> Option<&str> {
        self.0.name.as_deref()
    }

    /// The area as a sentence names it; `number`: its place among those of the project, from 1.
    pub fn said(&self, number: usize) -> Said {
        match self.name() {
            Some(name) => NAMED_AREA.say(&[("name", name.into())]),
            None => NUMBERED_AREA.say(&[("n", number.to_string().into())]),
        }
    }

    /// All its corners: of a box eight, of a polygon two above each other for each of its own.
    pub fn corners(&self) -> impl Iterator<Item = Point3<f64>> {
        let above = |[x, y]: [f64; 2], heights: [f64; 2]| heights.map(|z| Point3::new(x, y, z));
        let of_box = self
            .0
            .corners
            .iter()
            .flat_map(move |&[[ax, ay, az], [bx, by, bz]]| {
                [[ax, ay], [bx, ay], [bx, by], [ax, by]].map(|p| above(p, [az, bz]))
            });
        let heights = self.0.z.unwrap_or_default();
        let ring = self.0.polygon.iter().flatten();
        of_box.flatten().chain(ring.flat_map(move |&p| above(p, heights)))
    }

    /// The smallest box around the area.
    pub fn bounds(&self) -> Option<Bounds> {
        Bounds::of(self.corners())
    }

    /// Whether a point lies in it.
    pub fn contains(&self, p: &Point3<f64>) -> bool {
        let inside = self.bounds().is_some_and(|b| b.contains(p));
        inside && self.0.polygon.as_ref().is_none_or(|ring| encloses(ring, p))
    }
}

/// Even-odd rule.
fn encloses(ring: &[[f64; 2]], p: &Point3<f64>) -> bool {
    let edges = ring.iter().zip(ring.iter().cycle().skip(1));
    let crossings = edges.filter(|(a, b)| {
        (a[1] > p.y) != (b[1] > p.y) && p.x < a[0] + (p.y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
    });
    crossings.count() % 2 == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<StableArea, String> {
        toml::from_str(text).map_err(|e| e.message().to_owned())
    }

    #[test]
    fn boxes_and_polygons_hold_what_they_should() {
        let area = read("corners = [[1.0, 2.0, 0.0], [0.0, 0.0, 3.0]]").unwrap();
        assert!(area.contains(&Point3::new(0.5, 1.9, 1.0)));
        assert!(!area.contains(&Point3::new(0.5, 2.1, 1.0)));
        let area = read("polygon = [[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]]\nz = [-1.0, 1.0]").unwrap();
        assert!(area.contains(&Point3::new(0.5, 0.5, 0.0)));
        assert!(!area.contains(&Point3::new(1.5, 1.5, 0.0)));
        assert!(!area.contains(&Point3::new(0.5, 0.5, 1.5)));
        let again: StableArea = toml::from_str(&toml::to_string(&area).unwrap()).unwrap();
        assert_eq!(again, area);
    }

    #[test]
    fn impossible_areas_are_refused_with_what_is_needed() {
        for (text, reason) in [
            ("z = [0.0, 1.0]", "either a box"),
            (
                "corners = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0]]",
                "differ in x, y and z",
            ),
            (
                "polygon = [[0.0, 0.0], [1.0, 0.0]]\nz = [0.0, 1.0]",
                "three corners",
            ),
            (
                "polygon = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]\nz = [1.0, 0.0]",
                "[lowest, highest]",
            ),
            ("polygon = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]", "either a box"),
            ("nam = \"a\"", "unknown field"),
            ("name = \"a\"", "either a box"),
        ] {
            assert!(read(text).unwrap_err().contains(reason), "{text}");
        }
    }
}

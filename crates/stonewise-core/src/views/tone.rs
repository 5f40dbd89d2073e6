//! What views show, and how bright.

use super::walls::Walls;
use crate::cloud::Cloud;
use crate::geometry::{CellMap, cell_of, cells_between, floor};
use crate::statistics::upper_median;
use nalgebra::Point3;
use rayon::prelude::*;

/// Edge of the cells in which intensities are brought to one level, metres: range and incidence hardly change
/// within them, and they hold several stones.
const CELL_M: f64 = 1.0;
/// Patches along the edge of a cell. Contrast is the spread of their means, which keep differences between stones and
/// average out the noise of points.
const PATCHES: i64 = 10;
/// Fewest points of a patch, and fewest such patches of a cell, for which contrast is computed.
const LEAST_POINTS: f64 = 2.0;
const LEAST_PATCHES: f64 = 10.0;
/// Grey of a point of mean intensity, and how much brighter one is that lies a standard deviation above.
const MIDDLE: f64 = 110.0;
const SPREAD: f64 = 22.0;
/// Part of the points that must have a colour other than black.
const LEAST_COLOURED: f64 = 0.5;
/// Least typical deviation of patches from the mean of their cell, as a part of this mean, with which colours or
/// intensities show stones.
const LEAST_CONTRAST: f64 = 0.03;
/// Part of the points that may be brighter than white.
const OVEREXPOSED: f64 = 0.01;
/// Brightness of the darkest of these after brightening, and the most that colours are brightened.
const BRIGHT: f64 = 225.0;
const MOST_BRIGHTENING: f64 = 4.0;

/// What the pixels of views show.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Shade {
    /// The colours of the points.
    Colour,
    /// Their intensity, as grey.
    Intensity,
    /// Their relief under light from the upper left or the upper right, as grey.
    Relief,
}

/// Values of the points of a tile as surveyed.
pub struct PointValues<'a> {
    /// Red, green, blue, 16 bits each; black where a point has none.
    pub colours: &'a [[u16; 3]],
    /// Intensities in any unit; 0 where a point has none.
    pub intensities: &'a [f32],
    /// Station or strip of each point.
    pub sources: &'a [u32],
}

/// Collects the values of all points of an epoch to decide what its views show.
#[derive(Default)]
pub struct Tones {
    points: u64,
    coloured: u64,
    /// Points by the high byte and by the low byte of their brightness.
    bytes: [Vec<u64>; 2],
    colours: Patches,
    intensities: Patches,
}

impl Tones {
    /// Adds the points of a tile.
    pub fn add(&mut self, cloud: &Cloud, values: &PointValues) {
        self.bytes.iter_mut().for_each(|counts| counts.resize(256, 0));
        self.points += cloud.len() as u64;
        for i in 0..cloud.len() {
            let place = cloud.world(i);
            let brightest = brightness(values.colours[i]);
            if brightest > 0 {
                self.coloured += 1;
                self.bytes[0][usize::from(brightest >> 8)] += 1;
                self.bytes[1][usize::from(brightest & 255)] += 1;
                self.colours.add(0, &place, f64::from(brightest));
            }
            self.intensities
                .add(values.sources[i], &place, f64::from(values.intensities[i]));
        }
    }

    /// What views of the epoch show best: colours that most points have and that differ from patch to patch, else
    /// intensities that differ, else relief.
    pub fn decide(self) -> Toning {
        let are_coloured = self.coloured as f64 > LEAST_COLOURED * self.points as f64;
        let shade = if are_coloured && self.colours.contrast() > LEAST_CONTRAST {
            Shade::Colour
        } else if self.intensities.contrast() > LEAST_CONTRAST {
            Shade::Intensity
        } else {
            Shade::Relief
        };
        self.toning(shade)
    }

    /// How views show this.
    pub fn toning(self, shade: Shade) -> Toning {
        // Some programs write 8 bits into the 16 of a LAS file.
        let is_8_bit = self.bytes[0].iter().skip(1).all(|&n| n == 0);
        let counts = &self.bytes[usize::from(is_8_bit)];
        let unit = if is_8_bit { 1.0 } else { 1.0 / 257.0 };
        let mut brighter = 0;
        let most = OVEREXPOSED * self.coloured as f64;
        let white = (0..256).rev().find(|&v| {
            brighter += counts.get(v).copied().unwrap_or(0);
            brighter as f64 > most
        });
        let white = white.unwrap_or(255).max(1) as f64;
        Toning {
            shade,
            gain: unit * (BRIGHT / white).clamp(1.0, MOST_BRIGHTENING),
            intensities: self.intensities.levels(),
        }
    }
}

/// How the values of points become those of pixels.
pub struct Toning {
    shade: Shade,
    /// Factor of 16-bit colours.
    gain: f64,
    intensities: Levels,
}

impl Toning {
    /// What pixels show.
    pub fn shade(&self) -> Shade {
        self.shade
    }

    /// Red, green and blue of the points of a tile, 0 to 255. Intensities are evened out: what range, incidence
    /// and station do to all stones around is taken off. Level ground is black.
    pub fn values(&self, cloud: &Cloud, values: &PointValues, walls: &Walls) -> Vec<[u8; 3]> {
        let byte = |v: f64| v.round().clamp(1.0, 255.0) as u8;
        let of_point = |i: usize| match self.shade {
            Shade::Colour => values.colours[i].map(|v| byte(self.gain * f64::from(v))),
            Shade::Intensity => {
                let (mean, deviation) = self.intensities.at(values.sources[i], &cloud.world(i));
                // Where nothing differs, noise stays small.
                let unit = deviation
                    .max(0.5 * self.intensities.deviation * mean.abs())
                    .max(f64::MIN_POSITIVE);
                let difference = (f64::from(values.intensities[i]) - mean) / unit;
                [byte(MIDDLE + SPREAD * difference); 3]
            }
            Shade::Relief => [255; 3],
        };
        let or_black = |i: usize| match walls.is_level(&cloud.world(i)) {
            true => [0; 3],
            false => of_point(i),
        };
        (0..cloud.len()).into_par_iter().map(or_black).collect()
    }
}

/// Values by place and source, in the patches of cells.
#[derive(Default)]
struct Patches(CellMap<Key, Moments>);

/// Source and cell or patch.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
struct Key(u32, [i64; 3]);

impl Patches {
    fn add(&mut self, source: u32, place: &Point3<f64>, value: f64) {
        let patch = cell_of(place, CELL_M / PATCHES as f64);
        self.0.entry(Key(source, patch)).or_default().add(value);
    }

    /// The patches merged by cell.
    fn cells(&self) -> CellMap<Key, Cell> {
        let mut patches: Vec<(&Key, &Moments)> = self.0.iter().collect();
        patches.sort_by_key(|(key, _)| **key);
        let mut cells: CellMap<Key, Cell> = CellMap::default();
        for (Key(source, patch), moments) in patches {
            let key = Key(*source, patch.map(|place| place.div_euclid(PATCHES)));
            cells.entry(key).or_default().add(moments);
        }
        cells
    }

    /// Median of [`Cell::contrast`] over the cells.
    fn contrast(&self) -> f64 {
        let mut contrasts: Vec<f64> = self.cells().values().filter_map(Cell::contrast).collect();
        upper_median(&mut contrasts).unwrap_or(0.0)
    }

    fn levels(self) -> Levels {
        let cells = self.cells();
        let deviation = |cell: &Cell| {
            let (mean, deviation) = cell.points.mean_and_deviation();
            (cell.patches.count >= LEAST_PATCHES).then(|| deviation / mean.abs().max(f64::MIN_POSITIVE))
        };
        let mut deviations: Vec<f64> = cells.values().filter_map(deviation).collect();
        Levels {
            deviation: upper_median(&mut deviations).unwrap_or(0.0),
            cells: cells.into_iter().map(|(key, cell)| (key, cell.points)).collect(),
        }
    }
}

/// What the points of a cell show.
#[derive(Clone, Copy, Default)]
struct Cell {
    points: Moments,
    /// Means of the patches with enough points.
    patches: Moments,
    /// Sum of the variances of these means due to the scatter of the points within the patches.
    noise: f64,
}

impl Cell {
    fn add(&mut self, patch: &Moments) {
        self.points.merge(patch, 1.0);
        if patch.count >= LEAST_POINTS {
            let (mean, deviation) = patch.mean_and_deviation();
            self.patches.add(mean);
            self.noise += deviation.powi(2) / (patch.count - 1.0);
        }
    }

    /// Standard deviation of the means of the patches, corrected for noise, as a part of their mean; `None` with too few
    /// patches.
    fn contrast(&self) -> Option<f64> {
        let count = self.patches.count;
        let (mean, deviation) = self.patches.mean_and_deviation();
        let variance = deviation.powi(2) * count / (count - 1.0) - self.noise / count;
        (count >= LEAST_PATCHES).then(|| variance.max(0.0).sqrt() / mean.abs().max(f64::MIN_POSITIVE))
    }
}

/// Level and spread of values by place and source.
struct Levels {
    cells: CellMap<Key, Moments>,
    /// Typical standard deviation within a cell, as a part of its mean.
    deviation: f64,
}

impl Levels {
    /// Mean and standard deviation around a place: of the eight cells around it, the nearer the more.
    fn at(&self, source: u32, place: &Point3<f64>) -> (f64, f64) {
        let low = [0, 1, 2].map(|axis| floor(place[axis] / CELL_M - 0.5));
        let mut around = Moments::default();
        for cell in cells_between(low, low.map(|c| c + 1)) {
            if let Some(moments) = self.cells.get(&Key(source, cell)) {
                let apart = |axis: usize| (place[axis] / CELL_M - 0.5 - cell[axis] as f64).abs();
                let weight: f64 = (0..3).map(|axis| (1.0 - apart(axis)).max(0.0)).product();
                around.merge(moments, weight);
            }
        }
        around.mean_and_deviation()
    }
}

#[derive(Clone, Copy, Default)]
struct Moments {
    count: f64,
    sum: f64,
    squares: f64,
}

impl Moments {
    fn add(&mut self, value: f64) {
        self.count += 1.0;
        self.sum += value;
        self.squares += value * value;
    }

    fn merge(&mut self, other: &Self, weight: f64) {
        self.count += weight * other.count;
        self.sum += weight * other.sum;
        self.squares += weight * other.squares;
    }

    fn mean_and_deviation(&self) -> (f64, f64) {
        if self.count == 0.0 {
            return (0.0, 0.0);
        }
        let mean = self.sum / self.count;
        (mean, (self.squares / self.count - mean * mean).max(0.0).sqrt())
    }
}

/// The mean of red, green and blue.
fn brightness(colour: [u16; 3]) -> u16 {
    (colour.iter().map(|&v| u32::from(v)).sum::<u32>() / 3) as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::split_mix;
    use nalgebra::Point3;

    /// A wall of 4 x 3 m in chequers of 25 cm, a point every 2 cm.
    fn wall() -> Cloud {
        let places = (0..200).flat_map(|i| (0..150).map(move |j| [0.02 * f64::from(i), 0.02 * f64::from(j)]));
        Cloud::from_world(
            Point3::origin(),
            places
                .map(|[x, z]| Point3::new(x + 0.01, 0.0, z + 0.01))
                .collect::<Vec<_>>(),
        )
    }

    fn is_dark(place: &Point3<f64>) -> bool {
        (floor(place.x / 0.25) + floor(place.z / 0.25)) % 2 == 0
    }

    fn toning(cloud: &Cloud, values: &PointValues) -> Toning {
        let mut tones = Tones::default();
        tones.add(cloud, values);
        tones.decide()
    }

    const NO_WALLS: &[crate::surface::SurfaceCell] = &[];

    #[test]
    fn range_and_station_do_not_show_in_intensities() {
        let cloud = wall();
        // Every other point is of a station that measures all intensities three times as strong, and both lose
        // a fifth of it over the wall.
        let sources: Vec<u32> = (0..cloud.len() as u32).map(|i| i % 2).collect();
        let intensity = |i: usize| {
            let place = cloud.world(i);
            let stone = if is_dark(&place) { 80.0 } else { 120.0 };
            (stone * [1.0, 3.0][i % 2] * (1.0 - 0.05 * place.x)) as f32
        };
        let intensities: Vec<f32> = (0..cloud.len()).map(intensity).collect();
        let values = PointValues {
            colours: &vec![[0; 3]; cloud.len()],
            intensities: &intensities,
            sources: &sources,
        };
        let toning = toning(&cloud, &values);
        assert_eq!(toning.shade(), Shade::Intensity);
        let shown = toning.values(&cloud, &values, &Walls::among(NO_WALLS, 0.25));
        let greys = |dark: bool, source: usize| -> Vec<f64> {
            let own = (0..cloud.len()).filter(|i| i % 2 == source && is_dark(&cloud.world(*i)) == dark);
            own.map(|i| f64::from(shown[i][0])).collect()
        };
        let mean = |all: Vec<f64>| all.iter().sum::<f64>() / all.len() as f64;
        let spread = |all: &[f64]| {
            let ends = all
                .iter()
                .fold((255.0, 0.0), |(a, b): (f64, f64), v| (a.min(*v), b.max(*v)));
            ends.1 - ends.0
        };
        for dark in [true, false] {
            assert!((mean(greys(dark, 0)) - mean(greys(dark, 1))).abs() < 1.0);
            assert!(spread(&greys(dark, 0)) < 16.0, "{}", spread(&greys(dark, 0)));
        }
        let step = mean(greys(false, 0)) - mean(greys(true, 0));
        assert!((step - 2.0 * SPREAD).abs() < 5.0, "{step}");
    }

    #[test]
    fn the_best_values_that_the_points_have_are_shown() {
        let cloud = wall();
        let grey = |dark: u16, light: u16| -> Vec<[u16; 3]> {
            let of = |i| if is_dark(&cloud.world(i)) { dark } else { light };
            (0..cloud.len()).map(|i| [of(i); 3]).collect()
        };
        let (none, flat) = (vec![0.0; cloud.len()], vec![7.0; cloud.len()]);
        let strong: Vec<f32> = grey(90, 130).iter().map(|c| f32::from(c[0])).collect();
        let sources = vec![0; cloud.len()];
        let walls = Walls::among(NO_WALLS, 0.25);
        let look = |colours: &[[u16; 3]], intensities: &[f32]| {
            let values = PointValues {
                colours,
                intensities,
                sources: &sources,
            };
            let toning = toning(&cloud, &values);
            (toning.shade(), toning.values(&cloud, &values, &walls))
        };
        assert_eq!(look(&grey(0, 0), &none).0, Shade::Relief);
        assert_eq!(look(&grey(0, 0), &flat).0, Shade::Relief);
        assert_eq!(look(&grey(0, 0), &strong).0, Shade::Intensity);
        assert_eq!(look(&grey(9000, 9000), &strong).0, Shade::Intensity);
        let (shade, wide) = look(&grey(100 * 257, 200 * 257), &strong);
        assert_eq!(shade, Shade::Colour);
        // 8 bits in the 16 of a LAS file.
        assert_eq!(look(&grey(100, 200), &strong), (Shade::Colour, wide));
        // Points that differ by a quarter of their mean, but not from patch to patch.
        let noise = |i: usize| [75.0, 125.0][(split_mix(i as u64) % 2) as usize];
        let noisy: Vec<f32> = (0..cloud.len()).map(noise).collect();
        assert_eq!(look(&grey(0, 0), &noisy).0, Shade::Relief);
        let both: Vec<f32> = noisy.iter().zip(&strong).map(|(a, b)| a + b).collect();
        assert_eq!(look(&grey(0, 0), &both).0, Shade::Intensity);
    }
}

//! What the surfaces look like: stones of several rocks, mortar of the same hues, stains, moss, lichen,
//! grass.
//!
//! Colours are linear reflectances. Everything on a stone is a function of a place in the stone's own frame,
//! so that the texture moves with it.

use crate::world::day::Day;
use crate::world::noise::Noise;
use crate::world::props::Material;
use crate::world::scene::{Hit, Target};
use crate::world::wall::Wall;

/// Paints a wall on a day.
pub struct Painter {
    rock: Noise,
    grain: Noise,
    stain: Noise,
    moss: Noise,
    grass: Noise,
    stone: Noise,
    moss_share: f64,
    wet_share: f64,
}

type Rgb = [f64; 3];

/// Rocks by share: reflectance in dry state. Close to each other, and to the mortar's.
const ROCKS: [(f64, Rgb); 5] = [
    (0.34, [0.255, 0.245, 0.228]),
    (0.24, [0.345, 0.290, 0.218]),
    (0.16, [0.275, 0.215, 0.168]),
    (0.14, [0.178, 0.182, 0.186]),
    (0.12, [0.330, 0.315, 0.285]),
];
const MORTAR: Rgb = [0.315, 0.290, 0.248];
const MOSS: Rgb = [0.085, 0.105, 0.030];
const LICHEN: Rgb = [0.42, 0.42, 0.34];
const DIRT: Rgb = [0.105, 0.095, 0.080];

impl Painter {
    /// Colours of a wall by its seed, with the moss and the moisture of a day.
    pub fn new(wall_seed: u64, day: &Day) -> Self {
        let noise = |purpose: u64| Noise::new(wall_seed, 200 + purpose);
        Self {
            rock: noise(0),
            grain: noise(1),
            stain: noise(2),
            moss: noise(3),
            grass: noise(4),
            stone: noise(5),
            moss_share: day.moss,
            wet_share: day.wet,
        }
    }

    /// Reflectance of what a ray met.
    pub fn colour(&self, wall: &Wall, hit: &Hit) -> Rgb {
        match hit.target {
            Target::Stone(i, at) => {
                let stone = &wall.stones[i];
                let place = [stone.middle[0] + at[0], stone.middle[1] + at[1]];
                let bare = self.rock_colour(i, at);
                self.weather(bare, place, wall.outline_distance(i, place[0], place[1]))
            }
            Target::Other(Material::Mortar, place) => self.weather(self.mortar_colour(place), place, 0.0),
            Target::Other(material, _) => self.thing(material, hit),
        }
    }

    fn rock_colour(&self, i: usize, [x, y]: [f64; 2]) -> Rgb {
        let key = i as u64 * 8;
        let draw = |k: u64| self.stone.uniform(key + k);
        let mut left = draw(0);
        let base = ROCKS
            .iter()
            .find(|(share, _)| {
                left -= share;
                left < 0.0
            })
            .map_or(ROCKS[0].1, |r| r.1);
        let shift = f64::from(i as u32) * 5.3;
        let (px, py) = (x + shift, y - shift);
        let blotch = self.rock.octaves(px / 0.11, py / 0.09, 3, 0.6);
        let warm = self.rock.octaves(px / 0.17 + 40.0, py / 0.17, 2, 0.6);

        // Bedding: faint parallel bands at the stone's own angle.
        let angle = (draw(1) - 0.5) * 0.9;
        let bands = self
            .rock
            .at(px / 0.4, (py * angle.cos() - px * angle.sin()) / 0.014)
            * 0.10
            * draw(2);
        let grain = self.grain.octaves(px / 0.020, py / 0.017, 4, 0.85) * (0.14 + 0.22 * draw(3));
        let bright = (0.72 + 0.56 * draw(4)) * (1.0 + 0.42 * blotch + bands + grain).max(0.2);
        let hue = 0.10 * warm + 0.07 * (draw(5) - 0.5);

        [
            base[0] * bright * (1.0 + hue),
            base[1] * bright,
            base[2] * bright * (1.0 - 1.2 * hue),
        ]
    }

    fn mortar_colour(&self, [a, u]: [f64; 2]) -> Rgb {
        // Old mortar, repairs, and places where it is as dark as the stones.
        let patch = self.rock.octaves(a / 0.45 + 90.0, u / 0.35, 3, 0.6);
        let warm = self.rock.octaves(a / 0.3 - 70.0, u / 0.3, 2, 0.6);
        let grain = self.grain.octaves(a / 0.008, u / 0.008, 3, 0.8);
        let bright = (0.78 + 0.75 * patch + 0.16 * grain).clamp(0.32, 1.5);
        let hue = 0.12 * warm;
        [
            MORTAR[0] * bright * (1.0 + hue),
            MORTAR[1] * bright,
            MORTAR[2] * bright * (1.0 - 1.2 * hue),
        ]
    }

    /// Water, dirt, moss and lichen, on stones and mortar alike. `distance`: from the stone's outline,
    /// negative inside.
    fn weather(&self, bare: Rgb, [a, u]: [f64; 2], distance: f64) -> Rgb {
        let near_joint = (1.0 + distance / 0.035).clamp(0.0, 1.0);
        let mut colour = bare;
        // Streaks that run down from joints and from the crown.
        let streak = self
            .stain
            .octaves(a / 0.11 + 0.5 * self.stain.at(a / 0.3, u / 0.4), u / 1.1, 3, 0.55);
        let broad = self.stain.octaves(a / 0.8, u / 1.1, 2, 0.5);
        let dirt =
            (0.30 + 1.1 * broad + (0.25 + broad).max(0.0) * 0.9 * streak + 0.3 * near_joint).clamp(0.0, 1.0);
        colour = mix(colour, DIRT, 0.62 * dirt * dirt);
        let chalk =
            (self.stain.octaves(a / 0.09 - 30.0, u / 0.6, 3, 0.5) + 1.0 * broad - 0.45).clamp(0.0, 0.4);
        colour = mix(colour, [0.5, 0.48, 0.44], 0.65 * chalk);
        let lichen =
            self.moss.octaves(a / 0.022, u / 0.022, 2, 0.6) + 0.5 * self.moss.at(a / 0.4, u / 0.4 + 9.0);
        colour = mix(colour, LICHEN, ((lichen - 0.58) * 6.0).clamp(0.0, 0.6));
        let damp = self.moss.octaves(a / 0.55, u / 0.45, 3, 0.55) + 0.22 * (0.6 - u).max(-1.0);
        let tuft = self.moss.octaves(a / 0.028 + 50.0, u / 0.028, 3, 0.75);
        let moss = damp + 0.45 * tuft + 0.30 * near_joint - 0.62 / self.moss_share;
        colour = mix(
            colour,
            MOSS.map(|c| c * (1.0 + 0.9 * tuft)),
            (moss * 3.5).clamp(0.0, 0.9),
        );
        let wet = (broad + streak + self.wet_share - 0.45).clamp(0.0, 0.8);
        colour.map(|c| (c * (1.0 - 0.5 * wet)).clamp(0.012, 0.9))
    }

    fn thing(&self, material: Material, hit: &Hit) -> Rgb {
        let (p, range_m) = (&hit.point, hit.range_m);
        let n = |x: f64, y: f64, octaves: u32| self.grass.octaves(x, y, octaves, 0.72);
        let brighten = |c: Rgb, by: f64| c.map(|v| (v * (1.0 + by)).max(0.004));
        // Detail that a pixel at this range cannot show would only flicker.
        let fine = (18.0 / range_m).clamp(0.3, 1.0);

        match material {
            Material::Ground => {
                let blades = n(p.x / 0.03, p.y / 0.02, 3) * fine;
                let worn = n(p.x / 1.4 + 3.0, p.y / 1.1, 4);
                let grass = brighten(
                    [0.085, 0.105, 0.034],
                    0.85 * blades + 0.5 * n(p.x / 0.25, p.y / 0.25, 3),
                );
                let soil = brighten([0.16, 0.135, 0.095], 0.5 * blades);
                mix(grass, soil, ((worn - 0.12) * 3.0).clamp(0.0, 0.85))
            }
            Material::Bank => {
                let [s, t] = on_side(hit);
                let leaf = n(s / 0.05, t / 0.045, 4) * fine;
                let bush = n(s / 0.55 + 20.0, t / 0.5, 4);
                let mut c = brighten([0.060, 0.080, 0.024], 1.1 * leaf + 1.3 * bush);
                c[0] *= 1.0 + 0.5 * n(s / 0.9, t / 0.8 - 12.0, 2);
                c.map(|v| v.max(0.006))
            }
            Material::Leaf => brighten([0.045, 0.085, 0.018], 1.1 * n(p.y / 0.03, p.z / 0.03, 2)),
            Material::Concrete => brighten([0.33, 0.32, 0.29], 0.5 * n(p.y / 0.3, p.x / 0.3, 5)),
            Material::Plaster => brighten([0.47, 0.43, 0.345], 0.22 * n((p.y + p.x) / 0.5, p.z / 0.6, 5)),
            Material::Roof => brighten([0.23, 0.105, 0.075], 0.5 * n(p.y / 0.12, (p.x + p.z) / 0.3, 4)),
            Material::Door => brighten([0.055, 0.06, 0.062], 0.3 * n(p.y / 0.02, p.z / 0.6, 3)),
            Material::Metal => brighten([0.24, 0.245, 0.25], 0.35 * n(p.y / 0.1, p.z / 0.1, 3)),
            Material::Mortar => MORTAR,
        }
    }
}

/// Two coordinates along the side of a box that was hit, metres.
pub(super) fn on_side(hit: &Hit) -> [f64; 2] {
    let (p, n) = (&hit.point, hit.normal.abs());
    if n.x >= n.y && n.x >= n.z {
        [p.y, p.z]
    } else if n.y >= n.z {
        [p.x + 17.0, p.z]
    } else {
        [p.y, p.x - 29.0]
    }
}

fn mix(a: Rgb, b: Rgb, t: f64) -> Rgb {
    std::array::from_fn(|c| a[c] + (b[c] - a[c]) * t)
}

//! Things in front of the wall that are no stones: railings, pipes, cables, windows, doors, signs, targets, plants, people,
//! ornaments, small buildings.

use super::backdrop::building_angle;
use super::building::Facade;
use super::canvas::Canvas;
use super::draw::{Rng, between, chance, log_between, mix, normal, scaled, smoothstep};
use super::material::{linear, stone_colour};
use super::noise::{Field, Grain};

/// Something in front of the wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Object {
    /// What it is.
    pub kind: ObjectKind,
    /// Its middle in parts of the photo's width and height.
    pub centre: [f32; 2],
    /// Half its width and height, pixels.
    pub half_px: [f32; 2],
    /// Turn in the photo, radians.
    pub angle: f32,
    /// Main and second colour, linear.
    pub colours: [[f32; 3]; 2],
    /// Height over the wall, pixels, 0 to 12: how far its shadow falls.
    pub stands_px: f32,
}

/// Kinds of things in front of a wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObjectKind {
    /// Parallel bars with a rail across: railings, lattices, scaffolds.
    Railing,
    /// One long round bar: pipe, pole, cable.
    Pipe,
    /// A frame with panes.
    Window,
    /// A plain panel with marks like text.
    Sign,
    /// A disc of black and white sectors, or a chequered square, as surveyors use.
    Target,
    /// Leaves.
    Plant,
    /// A standing figure.
    Person,
    /// Carved rings and petals.
    Ornament,
    /// A patch of plaster over the stones.
    Patch,
    /// A moulded band.
    Cornice,
    /// A small house with smooth walls and a roof.
    Building,
}

/// From these one is drawn: railings and buildings, which stand before every dam, twice as often as the others.
const KINDS: [ObjectKind; 13] = [
    ObjectKind::Railing,
    ObjectKind::Railing,
    ObjectKind::Building,
    ObjectKind::Building,
    ObjectKind::Pipe,
    ObjectKind::Window,
    ObjectKind::Sign,
    ObjectKind::Target,
    ObjectKind::Plant,
    ObjectKind::Person,
    ObjectKind::Ornament,
    ObjectKind::Patch,
    ObjectKind::Cornice,
];

impl Object {
    /// A thing drawn at random for a photo whose shorter side has `shorter` pixels, before a wall of some colour.
    pub(super) fn random(shorter: f32, wall: [f32; 3], rng: &mut Rng) -> Self {
        let kind = KINDS[(between(rng, 0.0, KINDS.len() as f32) as usize).min(KINDS.len() - 1)];
        Self::of(kind, shorter, wall, rng)
    }

    /// Ornaments close together, as on a fountain or a portal.
    pub(super) fn carvings(shorter: f32, wall: [f32; 3], rng: &mut Rng) -> Vec<Self> {
        let middle = [between(rng, 0.0, 1.0), between(rng, 0.0, 1.0)];
        let spread = between(rng, 0.1, 0.3);
        let base = Self::of(ObjectKind::Ornament, shorter, wall, rng);
        (0..3 + (between(rng, 0.0, 7.0) as usize))
            .map(|_| {
                let kind = if chance(rng, 0.25) {
                    ObjectKind::Cornice
                } else {
                    ObjectKind::Ornament
                };
                let own = Self::of(kind, shorter, wall, rng);
                Self {
                    centre: middle.map(|c| c + spread * normal(rng)),
                    half_px: match kind {
                        ObjectKind::Cornice => [own.half_px[0], shorter * spread],
                        _ => own.half_px,
                    },
                    colours: base.colours,
                    ..own
                }
            })
            .collect()
    }

    fn of(kind: ObjectKind, shorter: f32, wall: [f32; 3], rng: &mut Rng) -> Self {
        let part = |low: f32, high: f32, rng: &mut Rng| shorter * log_between(rng, low, high);
        let long = 1.5 * shorter;
        let half_px = match kind {
            ObjectKind::Railing => [part(0.2, 1.5, rng), part(0.1, 0.8, rng)],
            ObjectKind::Pipe => [log_between(rng, 0.7, (0.05 * shorter).max(1.0)), long],
            ObjectKind::Cornice => [part(0.015, 0.12, rng), long],
            ObjectKind::Window => [part(0.08, 0.35, rng), part(0.08, 0.4, rng)],
            ObjectKind::Building => [part(0.1, 0.6, rng), part(0.15, 0.7, rng)],
            ObjectKind::Sign => [part(0.02, 0.15, rng), part(0.02, 0.15, rng)],
            ObjectKind::Target => [part(0.015, 0.07, rng); 2],
            ObjectKind::Plant | ObjectKind::Patch => [part(0.05, 0.35, rng), part(0.05, 0.35, rng)],
            ObjectKind::Person => {
                let height = part(0.1, 0.5, rng);
                [0.28 * height, height]
            }
            ObjectKind::Ornament => {
                let radius = part(0.05, 0.3, rng);
                [radius, radius * between(rng, 0.6, 1.4)]
            }
        };
        let any = |rng: &mut Rng| {
            let grey = between(rng, 0.05, 0.9);
            [0, 1, 2].map(|_| linear((grey * (0.35 * normal(rng)).exp()).clamp(0.02, 0.95)))
        };
        let metal = |rng: &mut Rng| [linear(between(rng, 0.1, 0.75)); 3];
        let colours = match kind {
            ObjectKind::Railing | ObjectKind::Pipe => {
                let colour = if chance(rng, 0.7) { metal(rng) } else { any(rng) };
                [colour, colour]
            }
            ObjectKind::Plant => [[0.26, 0.34, 0.13], [0.38, 0.42, 0.22]]
                .map(|base| base.map(|c| linear(c) * (0.25 * normal(rng)).exp())),
            ObjectKind::Target => [[0.9; 3], [0.02; 3]],
            ObjectKind::Ornament | ObjectKind::Cornice | ObjectKind::Patch => {
                let colour = if chance(rng, 0.6) {
                    scaled(wall, (0.2 * normal(rng)).exp())
                } else {
                    stone_colour(rng)
                };
                [colour, scaled(colour, 0.7)]
            }
            _ => [any(rng), any(rng)],
        };
        Self {
            kind,
            centre: [between(rng, 0.0, 1.0), between(rng, 0.0, 1.0)],
            half_px,
            angle: match kind {
                ObjectKind::Pipe | ObjectKind::Cornice => building_angle(rng),
                _ => 0.1 * normal(rng),
            },
            colours,
            stands_px: match kind {
                ObjectKind::Railing | ObjectKind::Plant | ObjectKind::Person | ObjectKind::Building => {
                    between(rng, 2.0, 12.0)
                }
                ObjectKind::Window => -between(rng, 0.0, 6.0),
                _ => between(rng, 0.3, 4.0),
            },
        }
    }

    /// Paints the thing over the canvas.
    pub(super) fn paint(&self, canvas: &mut Canvas, rng: &mut Rng) {
        let size = canvas.photo_size();
        let middle = [self.centre[0] * size[0], self.centre[1] * size[1]];
        let brush = Brush::new(self, rng);
        let (sin, cos) = self.angle.sin_cos();
        let reach = self.half_px[0].hypot(self.half_px[1]) + 2.0;
        let range = |axis: usize, count: usize| {
            let from = ((middle[axis] - reach) * canvas.scale).max(0.0) as usize;
            let to = ((middle[axis] + reach) * canvas.scale).clamp(0.0, count as f32) as usize;
            from.min(count)..to
        };
        for y in range(1, canvas.height) {
            for x in range(0, canvas.width) {
                let p = canvas.photo(x, y);
                let (dx, dy) = (p[0] - middle[0], p[1] - middle[1]);
                let local = [dx * cos + dy * sin, dy * cos - dx * sin];
                if let Some((colour, height)) = brush.at(local) {
                    let i = y * canvas.width + x;
                    canvas.albedo[i] = colour;
                    canvas.relief[i] = self.stands_px + height;
                    canvas.openness[i] = 1.0;
                    canvas.label[i] = 0;
                    canvas.doubtful[i] = false;
                    canvas.sky[i] = false;
                }
            }
        }
    }
}

/// An object with what is drawn once for it.
struct Brush<'a> {
    object: &'a Object,
    rough: Field,
    leaves: Field,
    spacing: f32,
    bar: f32,
    sectors: f32,
    rings: f32,
    round: bool,
    motif: Motif,
    facade: Facade,
}

/// What an ornament shows.
enum Motif {
    Rosette,
    Scroll,
    Lattice,
    Flutes,
}

impl<'a> Brush<'a> {
    fn new(object: &'a Object, rng: &mut Rng) -> Self {
        let widest = object.half_px[0].max(object.half_px[1]);
        let bar = log_between(rng, 0.8, 10.0);
        Self {
            object,
            rough: Field::isotropic(rng, Grain::Fractal, (0.8 * widest).clamp(12.0, 150.0)),
            leaves: Field::sized(rng, Grain::Cells, 3.0, 14.0),
            spacing: bar * log_between(rng, 3.0, 45.0),
            bar,
            sectors: between(rng, 2.0, 9.0).floor(),
            rings: between(rng, 1.0, 6.0),
            round: chance(rng, 0.5),
            motif: match between(rng, 0.0, 4.0) as u32 {
                0 => Motif::Rosette,
                1 => Motif::Scroll,
                2 => Motif::Lattice,
                _ => Motif::Flutes,
            },
            facade: Facade::random(rng),
        }
    }

    /// Colour and height at a place relative to the object's middle; `None` beside it.
    fn at(&self, [x, y]: [f32; 2]) -> Option<([f32; 3], f32)> {
        let [main, second] = self.object.colours;
        let [half_x, half_y] = self.object.half_px;
        let inside = x.abs() < half_x && y.abs() < half_y;
        let radius = (x / half_x).hypot(y / half_y);
        match self.object.kind {
            ObjectKind::Railing => {
                let across = x - (x / self.spacing).round() * self.spacing;
                let rail = [-0.9 * half_y, 0.0, 0.9 * half_y]
                    .map(|at| (y - at).abs())
                    .into_iter()
                    .fold(f32::INFINITY, f32::min);
                let off = across.abs().min(rail) / self.bar;
                (inside && off < 0.5).then(|| (main, round_bar(2.0 * off, 0.5 * self.bar)))
            }
            ObjectKind::Pipe => {
                let off = (x + 0.3 * half_x * self.rough.at(0.0, 0.3 * y)).abs() / half_x;
                (off < 1.0).then(|| (main, round_bar(off, half_x)))
            }
            ObjectKind::Cornice => {
                let off = x / half_x;
                let tone = 1.0 + 0.06 * self.rough.at(x, y);
                let profile = 1.0 + (off * self.rings * 2.0).sin();
                (off.abs() < 1.0).then(|| (scaled(main, tone), 0.2 * half_x * profile))
            }
            ObjectKind::Window => {
                let edge = (half_x - x.abs()).min(half_y - y.abs());
                let frame = 0.08 * half_x.min(half_y) + 1.0;
                let pane = |t: f32, half: f32| (t / half * 0.5 * self.sectors.min(4.0)).fract().abs();
                let bars = pane(x + half_x, half_x).min(pane(y + half_y, half_y)) < 0.08;
                let glass = mix(
                    second,
                    [0.3, 0.35, 0.4],
                    smoothstep(0.0, 2.0, self.rough.at(x, y)),
                );
                inside.then(|| {
                    if edge < frame || (bars && self.round) {
                        (main, 2.0)
                    } else {
                        (scaled(glass, 0.5), 0.0)
                    }
                })
            }
            ObjectKind::Sign => {
                let line = (y / half_y * self.sectors).fract().abs();
                let text = self.rough.at(4.0 * x, 0.2 * y) > 0.2;
                let margin = x.abs() < 0.8 * half_x && y.abs() < 0.8 * half_y;
                let mark = margin && text && (0.25..0.7).contains(&line);
                inside.then_some((if mark { second } else { main }, 0.5))
            }
            ObjectKind::Target => {
                let dark = if self.round {
                    let sector = (y.atan2(x) / std::f32::consts::TAU * self.sectors * 2.0).floor() as i32;
                    radius < 0.25 || (radius > 0.55 && radius < 0.8 && sector % 2 == 0)
                } else {
                    (x > 0.0) == (y > 0.0) && x.abs().max(y.abs()) < 0.85 * half_x
                };
                inside.then_some((if dark { second } else { main }, 0.3))
            }
            ObjectKind::Plant => {
                let leaf = self.leaves.at(x, y);
                let dense = radius + 0.45 * self.rough.at(x, y) + 0.3 * leaf;
                let tone = (1.5 - leaf) * (0.3 * self.rough.at(2.0 * x, 2.0 * y)).exp();
                let colour = mix(main, second, smoothstep(0.5, 0.2, leaf));
                (dense < 1.0).then(|| (scaled(colour, tone), -2.5 * leaf))
            }
            ObjectKind::Person => {
                let t = y / half_y;
                let head = x.hypot(y + 0.82 * half_y) < 0.16 * half_y;
                let broad = if t < 0.1 { 0.75 } else { 0.6 };
                let body = (-0.66..1.0).contains(&t) && x.abs() < half_x * broad;
                let skin = [0.45, 0.28, 0.2];
                (head || body).then(|| {
                    let colour = match (head, t < 0.1) {
                        (true, _) => skin,
                        (false, true) => main,
                        (false, false) => second,
                    };
                    let fold = 1.0 + 0.15 * self.rough.at(2.0 * x, y);
                    (scaled(colour, fold), round_bar(x.abs() / half_x, half_x))
                })
            }
            ObjectKind::Ornament => {
                let shape = if self.round { radius < 1.0 } else { inside };
                let turn = y.atan2(x) * self.sectors;
                let ring = radius * self.rings * std::f32::consts::TAU;
                let wave = match self.motif {
                    Motif::Rosette => (ring + turn.cos()).sin(),
                    Motif::Scroll => (ring + (turn / self.sectors)).sin(),
                    Motif::Lattice => {
                        (self.sectors * x / half_x * 3.0).sin() * (self.rings * y / half_y * 3.0).sin()
                    }
                    Motif::Flutes => (self.sectors * x / half_x * 4.0).sin(),
                };
                let tone = 1.0 + 0.1 * self.rough.at(x, y);
                let deep = half_x.min(half_y) * 0.06;
                shape.then(|| {
                    let colour = mix(main, second, smoothstep(0.2, -0.8, wave));
                    (scaled(colour, tone), deep * wave)
                })
            }
            ObjectKind::Building => {
                let plain = self.facade.at(x / half_x, y / half_y, main, second)?;
                Some((scaled(plain, 1.0 + 0.05 * self.rough.at(x, y)), 0.0))
            }
            ObjectKind::Patch => {
                let rough = self.rough.at(x, y);
                let colour = scaled(main, 1.0 + 0.08 * self.rough.at(3.0 * x, 3.0 * y));
                (radius + 0.35 * rough < 1.0).then_some((colour, 0.1 * rough))
            }
        }
    }
}

/// Height of a round bar of a radius, `off` of the radius from its axis.
fn round_bar(off: f32, radius: f32) -> f32 {
    radius * (1.0 - off * off).max(0.0).sqrt()
}

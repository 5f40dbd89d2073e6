//! Paints the things in front of a wall.

use super::building::Facade;
use super::canvas::Canvas;
use super::draw::{Rng, between, chance, log_between, mix, scaled, smoothstep};
use super::noise::{Field, Grain};
use super::object::{Object, ObjectKind};

impl Object {
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
                    canvas.piece[i] = canvas.current;
                    canvas.sky[i] = false;
                }
            }
        }
    }
}

/// Colour, and height over the object's own, pixels.
type Stroke = ([f32; 3], f32);

/// A place on an object.
struct Spot {
    /// From the object's middle, pixels.
    x: f32,
    y: f32,
    /// Half the object's width and height, pixels.
    half: [f32; 2],
    /// Whether the place lies in the object's rectangle.
    is_inside: bool,
    /// Distance from the middle, 1 at the ellipse that fills the rectangle.
    radius: f32,
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
    fn at(&self, [x, y]: [f32; 2]) -> Option<Stroke> {
        let half = self.object.half_px;
        let spot = Spot {
            x,
            y,
            half,
            is_inside: x.abs() < half[0] && y.abs() < half[1],
            radius: (x / half[0]).hypot(y / half[1]),
        };
        match self.object.kind {
            ObjectKind::Railing => self.railing(&spot),
            ObjectKind::Pipe => self.pipe(&spot),
            ObjectKind::Cornice => self.cornice(&spot),
            ObjectKind::Window => self.window(&spot),
            ObjectKind::Sign => self.sign(&spot),
            ObjectKind::Target => self.target(&spot),
            ObjectKind::Plant => self.plant(&spot),
            ObjectKind::Person => self.person(&spot),
            ObjectKind::Ornament => self.ornament(&spot),
            ObjectKind::Building => self.building(&spot),
            ObjectKind::Patch => self.patch(&spot),
        }
    }

    fn railing(&self, spot: &Spot) -> Option<Stroke> {
        let across = spot.x - (spot.x / self.spacing).round() * self.spacing;
        let rail = [-0.9 * spot.half[1], 0.0, 0.9 * spot.half[1]]
            .map(|at| (spot.y - at).abs())
            .into_iter()
            .fold(f32::INFINITY, f32::min);
        let off = across.abs().min(rail) / self.bar;
        let colour = self.object.colours[0];
        (spot.is_inside && off < 0.5).then(|| (colour, round_bar(2.0 * off, 0.5 * self.bar)))
    }

    fn pipe(&self, spot: &Spot) -> Option<Stroke> {
        let half = spot.half[0];
        let off = (spot.x + 0.3 * half * self.rough.at(0.0, 0.3 * spot.y)).abs() / half;
        (off < 1.0).then(|| (self.object.colours[0], round_bar(off, half)))
    }

    fn cornice(&self, spot: &Spot) -> Option<Stroke> {
        let off = spot.x / spot.half[0];
        let tone = 1.0 + 0.06 * self.rough.at(spot.x, spot.y);
        let profile = 1.0 + (off * self.rings * 2.0).sin();
        let colour = self.object.colours[0];
        (off.abs() < 1.0).then(|| (scaled(colour, tone), 0.2 * spot.half[0] * profile))
    }

    fn window(&self, spot: &Spot) -> Option<Stroke> {
        let (x, y, [half_x, half_y]) = (spot.x, spot.y, spot.half);
        let [main, second] = self.object.colours;
        let edge = (half_x - x.abs()).min(half_y - y.abs());
        let frame = 0.08 * half_x.min(half_y) + 1.0;
        let pane = |t: f32, half: f32| (t / half * 0.5 * self.sectors.min(4.0)).fract().abs();
        let bars = pane(x + half_x, half_x).min(pane(y + half_y, half_y)) < 0.08;
        let glass = mix(
            second,
            [0.3, 0.35, 0.4],
            smoothstep(0.0, 2.0, self.rough.at(x, y)),
        );
        spot.is_inside.then(|| {
            if edge < frame || (bars && self.round) {
                (main, 2.0)
            } else {
                (scaled(glass, 0.5), 0.0)
            }
        })
    }

    fn sign(&self, spot: &Spot) -> Option<Stroke> {
        let (x, y, [half_x, half_y]) = (spot.x, spot.y, spot.half);
        let [main, second] = self.object.colours;
        let line = (y / half_y * self.sectors).fract().abs();
        let text = self.rough.at(4.0 * x, 0.2 * y) > 0.2;
        let margin = x.abs() < 0.8 * half_x && y.abs() < 0.8 * half_y;
        let mark = margin && text && (0.25..0.7).contains(&line);
        spot.is_inside.then_some((if mark { second } else { main }, 0.5))
    }

    fn target(&self, spot: &Spot) -> Option<Stroke> {
        let (x, y, radius) = (spot.x, spot.y, spot.radius);
        let [main, second] = self.object.colours;
        let dark = if self.round {
            let sector = (y.atan2(x) / std::f32::consts::TAU * self.sectors * 2.0).floor() as i32;
            radius < 0.25 || (radius > 0.55 && radius < 0.8 && sector % 2 == 0)
        } else {
            (x > 0.0) == (y > 0.0) && x.abs().max(y.abs()) < 0.85 * spot.half[0]
        };
        spot.is_inside.then_some((if dark { second } else { main }, 0.3))
    }

    fn plant(&self, spot: &Spot) -> Option<Stroke> {
        let (x, y) = (spot.x, spot.y);
        let [main, second] = self.object.colours;
        let leaf = self.leaves.at(x, y);
        let dense = spot.radius + 0.45 * self.rough.at(x, y) + 0.3 * leaf;
        let tone = (1.5 - leaf) * (0.3 * self.rough.at(2.0 * x, 2.0 * y)).exp();
        let colour = mix(main, second, smoothstep(0.5, 0.2, leaf));
        (dense < 1.0).then(|| (scaled(colour, tone), -2.5 * leaf))
    }

    fn person(&self, spot: &Spot) -> Option<Stroke> {
        let (x, y, [half_x, half_y]) = (spot.x, spot.y, spot.half);
        let [main, second] = self.object.colours;
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

    fn ornament(&self, spot: &Spot) -> Option<Stroke> {
        let (x, y, [half_x, half_y]) = (spot.x, spot.y, spot.half);
        let [main, second] = self.object.colours;
        let shape = if self.round {
            spot.radius < 1.0
        } else {
            spot.is_inside
        };
        let turn = y.atan2(x) * self.sectors;
        let ring = spot.radius * self.rings * std::f32::consts::TAU;
        let wave = match self.motif {
            Motif::Rosette => (ring + turn.cos()).sin(),
            Motif::Scroll => (ring + (turn / self.sectors)).sin(),
            Motif::Lattice => (self.sectors * x / half_x * 3.0).sin() * (self.rings * y / half_y * 3.0).sin(),
            Motif::Flutes => (self.sectors * x / half_x * 4.0).sin(),
        };
        let tone = 1.0 + 0.1 * self.rough.at(x, y);
        let deep = half_x.min(half_y) * 0.06;
        shape.then(|| {
            let colour = mix(main, second, smoothstep(0.2, -0.8, wave));
            (scaled(colour, tone), deep * wave)
        })
    }

    fn building(&self, spot: &Spot) -> Option<Stroke> {
        let [main, second] = self.object.colours;
        let plain = self
            .facade
            .at(spot.x / spot.half[0], spot.y / spot.half[1], main, second)?;
        Some((scaled(plain, 1.0 + 0.05 * self.rough.at(spot.x, spot.y)), 0.0))
    }

    fn patch(&self, spot: &Spot) -> Option<Stroke> {
        let rough = self.rough.at(spot.x, spot.y);
        let tone = 1.0 + 0.08 * self.rough.at(3.0 * spot.x, 3.0 * spot.y);
        let colour = scaled(self.object.colours[0], tone);
        (spot.radius + 0.35 * rough < 1.0).then_some((colour, 0.1 * rough))
    }
}

/// Height of a round bar of a radius, `off` of the radius from its axis.
fn round_bar(off: f32, radius: f32) -> f32 {
    radius * (1.0 - off * off).max(0.0).sqrt()
}

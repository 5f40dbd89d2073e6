//! What to look at first: the worst of what deformed, moved, is loose, opened or is lost.

use super::html::with_units;
use crate::summary::Summary;
use crate::texts::fill;
use crate::verdict::zone_in_words;
use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use stonewise_results::records::{DeformedZone, EpochVerdict, JointVerdict, State, StoneVerdict};
use stonewise_results::{ResultSet, StoneRow};

/// Zones, stones and joints that are named at most.
const FIRST: usize = 5;

/// Something that calls for a closer look.
#[derive(Clone, Copy)]
enum Look<'a> {
    Stone(&'a StoneVerdict),
    Joint(&'a JointVerdict),
    Zone(&'a DeformedZone),
}

/// A [`Look`] among its kind: state, size in millimetres, number of the stone.
struct Ranked<'a> {
    look: Look<'a>,
    state: State,
    size_mm: f64,
    id: u32,
}

/// The zones of deformation, stones and joints that call for a closer look, the worst first; of a run in doubt none.
pub(super) fn look_first(results: &ResultSet, facts: &Summary) -> String {
    let texts = facts.texts;
    if !facts.verdict.is_sound() {
        return format!("<p>{}</p>", texts.page.look_at_doubt);
    }
    let rows: BTreeMap<u32, &StoneRow> = results.stones.iter().map(|s| (s.stone_id, s)).collect();
    let item = |look: &Look| match look {
        Look::Stone(verdict) => Some(stone(verdict, rows.get(&verdict.stone_id)?, facts)),
        Look::Joint(verdict) => Some(joint(verdict, facts)),
        Look::Zone(verdict) => Some(zone(verdict, facts)),
    };
    let items: String = worst(&facts.verdict)
        .iter()
        .filter_map(item)
        .take(FIRST)
        .map(|text| format!("<li>{}</li>", with_units(&text)))
        .collect();
    match (items.is_empty(), facts.verdict.state) {
        (true, State::CannotTell) => format!("<p>{}</p>", texts.page.none_stands_out),
        (true, _) => format!("<p>{}</p>", texts.page.nothing_first),
        _ => format!("<ol class=\"look\">{items}</ol>"),
    }
}

/// The stones that are named, the worst first.
pub(super) fn named(verdict: &EpochVerdict) -> Vec<u32> {
    let looks = worst(verdict).into_iter().take(FIRST);
    looks
        .flat_map(|look| match look {
            Look::Stone(stone) => vec![stone.stone_id],
            Look::Joint(joint) => joint.stones.to_vec(),
            Look::Zone(_) => Vec::new(),
        })
        .collect()
}

/// By state; within a state the worst of every kind, then the second of every kind and so on, so that no kind
/// hides another. Each stone comes once. A lost stone ranks with alarms.
fn worst(verdict: &EpochVerdict) -> Vec<Look<'_>> {
    let mut all: Vec<(State, usize, usize, Look)> = Vec::new();
    for (number, mut kind) in kinds(verdict).into_iter().enumerate() {
        kind.sort_by(worst_first);
        let mut places: BTreeMap<State, usize> = BTreeMap::new();
        for ranked in kind {
            let place = places.entry(ranked.state).or_insert(0);
            all.push((ranked.state, *place, number, ranked.look));
            *place += 1;
        }
    }
    all.sort_by(|a, b| b.0.cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut seen = BTreeSet::new();
    let looks = all.into_iter().map(|(.., look)| look);
    looks
        .filter(|look| match look {
            Look::Stone(stone) => seen.insert(stone.stone_id),
            Look::Joint(_) | Look::Zone(_) => true,
        })
        .collect()
}

/// Zones that deformed, stones that moved, are loose, are lost, and joints that opened beyond a threshold.
fn kinds(verdict: &EpochVerdict) -> [Vec<Ranked<'_>>; 5] {
    let stones = |is: fn(&StoneVerdict) -> bool, size: fn(&StoneVerdict) -> Option<f64>| {
        let stones = verdict.stones.iter().filter(|s| is(s));
        let ranked = stones.map(|stone| Ranked {
            look: Look::Stone(stone),
            state: if stone.lost { State::Alarm } else { stone.state },
            size_mm: size(stone).unwrap_or(0.0),
            id: stone.stone_id,
        });
        ranked.collect::<Vec<_>>()
    };
    let opened = verdict.joints.iter().filter(|j| j.state >= State::Attention);
    let joints = opened.map(|joint| Ranked {
        look: Look::Joint(joint),
        state: joint.state,
        size_mm: joint.opening_mm,
        id: joint.stones[0],
    });
    let deformed = verdict.deformation.iter().flat_map(|d| &d.zones);
    let zones = deformed.map(|zone| Ranked {
        look: Look::Zone(zone),
        state: zone.state,
        size_mm: zone.largest_mm,
        id: zone.zone_id,
    });
    [
        zones.collect(),
        stones(|s| s.moved, |s| s.length_mm),
        stones(|s| s.loose, |s| s.neighbours_mm),
        stones(|s| s.lost, |_| None),
        joints.collect(),
    ]
}

fn worst_first(a: &Ranked, b: &Ranked) -> Ordering {
    b.state
        .cmp(&a.state)
        .then(b.size_mm.total_cmp(&a.size_mm))
        .then(a.id.cmp(&b.id))
}

/// A stone, its place, and what is the matter with it.
fn stone(verdict: &StoneVerdict, row: &StoneRow, facts: &Summary) -> String {
    let (texts, page) = (facts.texts, &facts.texts.page);
    let place = [
        ("along", &*texts.number(row.along_m, 2)),
        ("up", &*texts.number(row.up_m, 2)),
    ];
    let mut all = Vec::new();
    if verdict.lost {
        all.push(page.lost_stone.to_owned());
    }
    if verdict.moved {
        let text = match facts.verdict.has_datum() {
            true => page.moved_stone,
            false => page.moved_stone_common,
        };
        all.push(measured(text, verdict.length_mm, verdict.interval_mm, facts));
    }
    if verdict.loose {
        let (length, interval) = (verdict.neighbours_mm, verdict.neighbours_interval_mm);
        all.push(measured(page.loose_stone, length, interval, facts));
    }
    format!(
        "<a data-stone=\"{0}\">{1} {0}</a>, {2}: {3}",
        verdict.stone_id,
        page.stone,
        fill(page.along_up, &place),
        all.join("; ")
    )
}

/// A joint and how far it opened.
fn joint(verdict: &JointVerdict, facts: &Summary) -> String {
    let [a, b] = verdict
        .stones
        .map(|id| format!("<a data-stone=\"{id}\">{id}</a>"));
    let text = fill(facts.texts.page.opened_joint, &[("a", &*a), ("b", &*b)]);
    measured(&text, Some(verdict.opening_mm), Some(verdict.interval_mm), facts)
}

/// A zone of deformation, its place, and what it did.
fn zone(verdict: &DeformedZone, facts: &Summary) -> String {
    let (texts, page) = (facts.texts, &facts.texts.page);
    let place = [
        ("along", &*texts.number(verdict.along_m, 2)),
        ("up", &*texts.number(verdict.up_m, 2)),
    ];
    format!(
        "<a href=\"#maps\">{} {}</a>, {}: {}",
        page.zone,
        verdict.zone_id,
        fill(page.along_up, &place),
        zone_in_words(verdict, texts)
    )
}

/// The text with a length and its interval, millimetres.
fn measured(text: &str, length: Option<f64>, interval: Option<[f64; 2]>, facts: &Summary) -> String {
    let mm = |millimetres: f64| facts.texts.mm(millimetres / 1e3);
    let [low, high] = interval.unwrap_or([f64::NAN; 2]).map(mm);
    let length = mm(length.unwrap_or(f64::NAN));
    fill(text, &[("length", &*length), ("low", &*low), ("high", &*high)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_core::registration::{Against, ZoneKind};
    use stonewise_results::records::DeformationVerdict;

    #[test]
    fn no_kind_hides_another_and_alarms_come_first() {
        let stone = |id: u32, state, [moved, loose, lost]: [bool; 3], length: f64| StoneVerdict {
            stone_id: id,
            state,
            moved,
            loose,
            lost,
            length_mm: Some(length),
            neighbours_mm: Some(length / 2.0),
            ..StoneVerdict::default()
        };
        let (moved, loose, both, lost) = (
            [true, false, false],
            [false, true, false],
            [true, true, false],
            [false, false, true],
        );
        let joint = |stones, state| JointVerdict {
            stones,
            state,
            decided_by: None,
            opening_mm: 6.0,
            interval_mm: [5.5, 6.5],
            q: 0.001,
        };
        let verdict = EpochVerdict {
            stones: vec![
                stone(1, State::Attention, moved, 99.0),
                stone(2, State::Alarm, moved, 40.0),
                stone(3, State::Alarm, moved, 41.0),
                stone(4, State::Alarm, both, 42.0),
                stone(5, State::Alarm, loose, 12.0),
                stone(6, State::Attention, lost, 0.0),
                stone(7, State::Fine, [false; 3], 1.0),
            ],
            joints: vec![
                joint([1, 2], State::CannotTell),
                joint([2, 3], State::Attention),
                joint([4, 5], State::Alarm),
            ],
            deformation: Some(DeformationVerdict {
                zones: vec![DeformedZone {
                    zone_id: 1,
                    state: State::Attention,
                    decided_by: None,
                    kind: ZoneKind::Bulge,
                    against: Against::RestOfWall,
                    along_m: 1.0,
                    up_m: 2.0,
                    diameter_m: None,
                    length_m: 2.0,
                    width_m: 1.0,
                    area_m2: 1.5,
                    mean_mm: [0.0, 0.0, 2.0],
                    largest_mm: 3.0,
                    interval_mm: [2.0, 4.0],
                }],
                ..DeformationVerdict::default()
            }),
            ..EpochVerdict::default()
        };
        let found = worst(&verdict).into_iter().map(|look| match look {
            Look::Stone(stone) => vec![stone.stone_id],
            Look::Joint(joint) => joint.stones.to_vec(),
            Look::Zone(zone) => vec![100 + zone.zone_id],
        });
        let expected: [&[u32]; 9] = [&[4], &[6], &[4, 5], &[3], &[5], &[2], &[101], &[1], &[2, 3]];
        assert_eq!(found.collect::<Vec<_>>(), expected);
    }
}

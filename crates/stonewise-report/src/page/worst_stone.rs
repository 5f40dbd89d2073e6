//! The worst stone before and after, in a section through its middle.

use super::html::figure;
use super::look_first::named;
use super::pair::epoch_names;
use crate::draw::{Guide, Series, scatter};
use crate::summary::Summary;
use crate::texts::fill;
use stonewise_figure::escape;
use stonewise_results::{Cut, ResultSet, SectionPoint, Sorted};

/// Points of both epochs in that of two sections which shows more of the motion of the stone to look at first; empty
/// where no stone is named, or the results have no sections.
pub(super) fn before_and_after(results: &ResultSet, facts: &Summary) -> String {
    if !facts.verdict.is_sound() {
        return String::new();
    }
    let (texts, page) = (facts.texts, &facts.texts.page);
    let motion = |id: u32| Some((id, facts.measured.iter().find(|(s, _)| s.stone_id == id)?.1));
    let Some((id, motion)) = named(&facts.verdict).into_iter().find_map(motion) else {
        return String::new();
    };
    let is_level = motion.face.x.abs() > motion.face.y.abs();
    let cut = if is_level { Cut::Level } else { Cut::Upright };
    let of_stone = |p: &&SectionPoint| p.stone_id == id && p.cut == cut;
    let points: Vec<&SectionPoint> = results.evidence.sections.iter().filter(of_stone).collect();
    if points.is_empty() {
        return String::new();
    }

    let place_m = |p: &SectionPoint| f64::from(p.place_m);
    let out_mm = |p: &SectionPoint| 1e3 * f64::from(p.out_m);
    let axis = |label: &str, value: &dyn Fn(&SectionPoint) -> f64| {
        let values = Sorted::new(points.iter().map(|p| value(p)));
        // Single points in front of the wall would make the rest small.
        let [low, high] = [0.01, 0.99].map(|q| values.quantile(q).unwrap_or(0.0));
        let room = 0.1 * (high - low);
        texts.axis(label, [low - room, high + room])
    };
    let along = axis(page.section_place, &place_m);
    let out = axis(page.section_out, &out_mm);
    // A level section is seen from above, an upright one from the side.
    let series = [("a", false), ("b", true)].map(|(class, is_later)| Series {
        class,
        points: points
            .iter()
            .filter(|p| p.is_later == is_later)
            .map(|p| [place_m(p), out_mm(p)])
            .filter(|[place, o]| {
                let within = |value: &f64, [low, high]: [f64; 2]| (low..=high).contains(value);
                within(place, along.range) && within(o, out.range)
            })
            .map(|[place, out]| if is_level { [place, out] } else { [out, place] })
            .collect(),
    });
    let axes = if is_level { [along, out] } else { [out, along] };
    let title = fill(page.section_title, &[("id", &*id.to_string())]);
    let names = results
        .run
        .as_ref()
        .and_then(|run| epoch_names(run, results.pair));
    let key = names.map_or(String::new(), |[first, later]| {
        let dot = |class: &str, name: &str| format!("<i class=\"key dot {class}\"></i>{}", escape(name));
        format!(": {} {}", dot("a", &first), dot("b", &later))
    });
    let note = format!("{}{key}.", page.section_note[usize::from(!is_level)]);
    format!(
        "<div class=\"before-after\">{}</div>",
        figure(&title, &scatter("", &title, axes, &series, Guide::None), &note)
    )
}

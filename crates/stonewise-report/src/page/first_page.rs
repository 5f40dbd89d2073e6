//! The first page: the verdict, who measured what and when, what was not measured, what to look at first, a
//! place to sign.

use super::html::{table, with_units};
use super::look_first::look_first;
use super::maps::lead_map;
use super::worst_stone::before_and_after;
use crate::summary::Summary;
use crate::texts::{Texts, counted, fill};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use stonewise_base::messages::Translations;
use stonewise_base::report_params::Language;
use stonewise_figure::{count, escape};
use stonewise_results::records::{Datum, DatumState, EpochRecord, Remark, State};
use stonewise_results::{ResultSet, Status};

/// Logo and kind of the document.
pub(super) fn letterhead(results: &ResultSet, kind: &str) -> String {
    let logo = results.evidence.logo.as_ref().map_or(String::new(), |logo| {
        let data = STANDARD.encode(&logo.bytes);
        format!(
            "<img class=\"logo\" alt=\"\" src=\"data:{};base64,{data}\">",
            logo.media_type
        )
    });
    format!("{logo}<p class=\"kind\">{kind}</p>")
}

/// The verdict in one sentence with its traffic light.
pub(super) fn verdict(facts: &Summary) -> String {
    let state = facts.verdict.state;
    let lamp = |of: State, class: &str| {
        let lit = if of == state { " lit" } else { "" };
        format!("<span class=\"lamp {class}{lit}\"></span>")
    };
    let lamps = [
        lamp(State::Alarm, "red"),
        lamp(State::Attention, "yellow"),
        lamp(State::Fine, "green"),
    ];
    let class = state.word().replace(' ', "-");
    format!(
        "<div class=\"verdict {class}\" role=\"status\"><span class=\"light\" aria-hidden=\"true\">{}</span><p>{}</p></div>",
        lamps.concat(),
        escape(&with_units(&facts.verdict.sentence))
    )
}

/// What to do after the verdict, and why there is one without thresholds.
pub(super) fn next(results: &ResultSet, facts: &Summary) -> String {
    let page = &facts.texts.page;
    let [fine, look, mend] = page.next;
    let next = match facts.verdict.state {
        State::Fine => fine,
        State::Attention | State::Alarm => look,
        State::CannotTell => mend,
    };
    let is_by_motion = facts.verdict.state == State::Attention && results.thresholds().is_empty();
    let why = if is_by_motion { page.no_thresholds } else { "" };
    format!("<p class=\"next\">{why} {next}</p>")
}

/// Who measured, with what, and the number of the report.
pub(super) fn letter(facts: &Summary) -> String {
    let page = &facts.texts.page;
    let given = [
        (page.reference_number, &facts.cover.reference_number),
        (page.operator, &facts.cover.operator),
        (page.instruments, &facts.cover.instruments),
        (page.calibration, &facts.cover.calibration),
    ];
    let items: String = given
        .iter()
        .filter_map(|(name, value)| {
            Some(format!(
                "<div><dt>{name}</dt><dd>{}</dd></div>",
                escape(value.as_ref()?)
            ))
        })
        .collect();
    match items.is_empty() {
        true => items,
        false => format!("<dl class=\"letter\">{items}</dl>"),
    }
}

/// Who measured, and the epochs with their dates and conditions.
pub(super) fn cover(results: &ResultSet, facts: &Summary) -> String {
    let page = &facts.texts.page;
    let mut out = letter(facts);
    if let Some(run) = &results.run {
        let dash = || "\u{2013}".to_owned();
        let row = |(i, epoch): (usize, &EpochRecord)| {
            let note = if i == 0 {
                format!(" ({})", page.reference)
            } else {
                String::new()
            };
            vec![
                format!("<b>{}</b>{note}", escape(&epoch.name)),
                epoch.date.as_deref().map_or_else(dash, escape),
                conditions(epoch, facts.texts).unwrap_or_else(dash),
            ]
        };
        let chosen = [0, results.pair];
        let epochs = chosen.iter().filter_map(|i| Some((*i, run.epochs.get(*i)?)));
        let rows: Vec<Vec<String>> = epochs.map(row).collect();
        out.push_str("<div class=\"epochs\">");
        out.push_str(&table(&[page.epochs, page.date, page.conditions], &rows, 3));
        out.push_str("</div>");
    }
    out
}

/// Conditions by name, with the unit that the end of the name gives.
pub(super) fn conditions(epoch: &EpochRecord, texts: &Texts) -> Option<String> {
    const UNITS: [(&str, &str); 5] = [
        ("_c", "\u{b0}C"),
        ("_mm", "mm"),
        ("_m", "m"),
        ("_percent", "%"),
        ("_hpa", "hPa"),
    ];
    let one = |(name, value): (&String, &f64)| {
        let lower = name.to_lowercase();
        let unit = UNITS.iter().find(|(end, _)| lower.ends_with(end));
        let (stem, unit) = match unit {
            Some((end, unit)) => (&name[..name.len() - end.len()], format!("\u{a0}{unit}")),
            None => (name.as_str(), String::new()),
        };
        let value = value.to_string().replace('.', texts.decimal);
        format!("{} {value}{unit}", escape(&texts.condition(stem)))
    };
    let list: Vec<String> = epoch.conditions.iter().map(one).collect();
    (!list.is_empty()).then(|| list.join(", "))
}

/// What to look at first, what was not measured, the zones, the map, the place to sign.
pub(super) fn body(results: &ResultSet, facts: &Summary) -> String {
    let page = &facts.texts.page;
    let map = if facts.measured.is_empty() {
        String::new()
    } else {
        lead_map(results, facts)
    };
    format!(
        "<div class=\"statement\"><div class=\"first\"><p class=\"limit\">{}</p><h3>{}</h3>{}</div><div class=\"first rest\"><h3>{}</h3>{}</div>\
         <div class=\"beside\">{map}{}{}</div></div>\
         {}",
        limit(facts),
        page.look_first,
        look_first(results, facts),
        page.not_measured,
        not_measured(facts),
        before_and_after(results, facts),
        zones(facts),
        signature(results, facts.texts)
    )
}

/// The place to sign, or who signed; a signature under other results does not count.
fn signature(results: &ResultSet, texts: &Texts) -> String {
    let page = &texts.page;
    let Some(of) = &results.remarks.signature else {
        return place_to_sign(texts);
    };
    let day = &of.when.to_string()[..10];
    if !results.is_signed {
        let note = fill(page.signed_others, &[("who", &*escape(&of.who)), ("day", day)]);
        return format!("<p class=\"datum\">{note}</p>{}", place_to_sign(texts));
    }
    let place = match of.place.as_str() {
        "" => day.to_owned(),
        place => format!("{place}, {day}"),
    };
    let mark = fill(
        page.signed,
        &[("digest", of.blake3.get(..12).unwrap_or(&of.blake3))],
    );
    sign_block(
        texts,
        [&of.who, &place, &mark].map(|given| format!("<b>{}</b><br>", escape(given))),
    )
}

/// Lines to sign by hand.
pub(super) fn place_to_sign(texts: &Texts) -> String {
    sign_block(texts, [const { String::new() }; 3])
}

/// Assessor, place and date, and signature, with what stands above each name.
fn sign_block(texts: &Texts, [who, place, mark]: [String; 3]) -> String {
    let page = &texts.page;
    format!(
        "<div class=\"sign\"><p>{who}{}</p><p>{place}{}</p><p>{mark}{}</p></div>",
        page.assessor, page.place_date, page.signature
    )
}

/// What people remarked on this pair of epochs; empty where nobody did.
pub(super) fn remarks(results: &ResultSet, facts: &Summary) -> String {
    let page = &facts.texts.page;
    let epochs = results.run.as_ref().map(|run| &run.epochs);
    let epoch = epochs.and_then(|epochs| epochs.get(results.pair));
    let is_here =
        |remark: &&Remark| remark.epoch.is_empty() || epoch.is_none_or(|epoch| epoch.name == remark.epoch);
    let one = |remark: &Remark| {
        let about = match (remark.stone, remark.zone) {
            (Some(stone), _) => format!("{} {stone}", page.stone),
            (None, Some(zone)) => format!("{} {zone}", page.zone),
            (None, None) => page.wall.to_owned(),
        };
        format!(
            "<li><b>{about}</b>: {} <span class=\"note\">({}, {})</span></li>",
            escape(&remark.text),
            escape(&remark.who),
            remark.when.minute()
        )
    };
    let items: String = results.remarks.remarks.iter().filter(is_here).map(one).collect();
    match items.as_str() {
        "" => String::new(),
        items => format!("<h3>{}</h3><ul class=\"remarks\">{items}</ul>", page.remarks),
    }
}

/// The detection limit in plain words.
fn limit(facts: &Summary) -> String {
    let texts = facts.texts;
    if !facts.verdict.is_sound() {
        return format!("<b>{}</b>", texts.page.limit_unknown);
    }
    let Some(median) = facts.limits.median() else {
        return String::new();
    };
    let text = fill(
        texts.clauses.detection_limit(facts.verdict.has_datum()),
        &[("median", &*texts.mm(median))],
    );
    let mut letters = text.chars();
    let first = letters
        .next()
        .map(|c| c.to_uppercase().to_string())
        .unwrap_or_default();
    format!("<b>{}</b>", with_units(&format!("{first}{}", letters.as_str())))
}

/// How many stones have no motion, and why.
fn not_measured(facts: &Summary) -> String {
    let texts = facts.texts;
    if facts.not_measured() == 0 {
        return format!("<p>{}</p>", texts.page.all_measured);
    }
    let reasons: String = facts
        .by_status
        .iter()
        .filter(|(status, _)| *status != Status::Ok)
        .map(|(status, stones)| {
            let n = stones.len();
            format!(
                "<li>{} ({}): {}</li>",
                count(n),
                texts.percent(n, facts.stones),
                escape(texts.status(*status))
            )
        })
        .collect();
    let all = counted(
        texts.page.of_not_measured,
        facts.not_measured(),
        &[("m", &count(facts.stones))],
    );
    format!("<p>{all}</p><ul class=\"unmeasured\">{reasons}</ul>")
}

/// The states of the zones; empty without zones.
fn zones(facts: &Summary) -> String {
    let (texts, page) = (facts.texts, &facts.texts.page);
    if facts.verdict.zones.is_empty() {
        return String::new();
    }

    let row = |zone: &stonewise_results::records::ZoneVerdict| {
        let largest = zone.area.largest.filter(|_| facts.verdict.is_sound());
        let moved = match facts.verdict.is_sound() {
            true => count(zone.area.moved),
            false => "\u{2013}".to_owned(),
        };
        vec![
            escape(&zone.name),
            texts.state(zone.area.state).to_owned(),
            count(zone.area.stones),
            count(zone.area.measured),
            moved,
            texts.mm_or_dash(largest.map(|l| l.length_mm / 1e3)),
        ]
    };

    let rows: Vec<Vec<String>> = facts.verdict.zones.iter().map(row).collect();
    let head = [
        page.zone,
        page.state,
        page.stones,
        page.measured,
        page.moved,
        page.largest,
    ];
    format!("<h3>{}</h3>{}", page.zones, table(&head, &rows, 2))
}

/// What is known about the registration of the epochs; a run in doubt has no limits that could hold it.
pub(super) fn registration(datum: Option<&Datum>, facts: &Summary) -> String {
    let (texts, page) = (facts.texts, &facts.texts.page);
    let is_sound = facts.verdict.is_sound();
    match datum {
        Some(datum) if datum.state != DatumState::Unknown => {
            let text = match is_sound {
                true => page.registration_included,
                false => page.registration_in_doubt,
            };
            fill(text, &[("note", &*said(&datum.note, &datum.translations, texts))])
        }
        Some(_) if is_sound => page.registration_unknown.to_owned(),
        Some(_) => page.registration_unknown_in_doubt.to_owned(),
        None => page.no_registration.to_owned(),
    }
}

/// What a run said, as HTML in the language of the report, or marked as English; commands between backticks
/// as code.
pub(super) fn said(english: &str, translations: &Translations, texts: &Texts) -> String {
    match translations.get(&texts.language) {
        Some(text) => with_code(text),
        None if texts.language == Language::English => with_code(english),
        None => format!("<span lang=\"en\">{}</span>", with_code(english)),
    }
}

pub(super) fn with_code(message: &str) -> String {
    let escaped = escape(message);
    if escaped.matches('`').count() % 2 == 1 {
        return escaped;
    }
    let part = |(i, part): (usize, &str)| match i % 2 {
        0 => part.to_owned(),
        _ => format!("<code>{part}</code>"),
    };
    escaped.split('`').enumerate().map(part).collect()
}

/// The warning that limits do not hold the registration error, where it is unknown.
pub(super) fn datum_warning(datum: Option<&Datum>, facts: &Summary) -> String {
    match datum {
        Some(datum) if datum.state == DatumState::Unknown => {
            format!("<p class=\"datum\">{}</p>", registration(Some(datum), facts))
        }
        _ => String::new(),
    }
}

//! The answers of a series in words.

use crate::texts::{Texts, counted, fill};
use stonewise_base::report_params::Language;
use stonewise_core::series::{Answer, Extrapolation, Inseparable, Term, Unanswered, WhyInseparable, Word};
use stonewise_figure::{count, number};
use stonewise_results::records::{AnswerVerdict, SeriesVerdict, TrendsRecord};

/// The four answers with their sentences.
pub fn series_verdict(found: &TrendsRecord, language: Language) -> SeriesVerdict {
    answers(found, Texts::of(language))
}

pub(crate) fn answers(found: &TrendsRecord, texts: &Texts) -> SeriesVerdict {
    let names = &texts.series;
    let answers = &found.answers;
    let [predicted, past, trend, anomaly] = [
        with_extrapolations(
            in_words(&answers.as_predicted, names.not_predicted, names.predicted, texts),
            &answers.as_predicted,
            texts,
        ),
        in_words(&answers.as_in_the_past, names.not_past, names.past, texts),
        in_words(&answers.trend, names.trend, names.no_trend, texts),
        in_words(&answers.anomaly, names.anomaly, names.no_anomaly, texts),
    ];
    let mut clauses: Vec<&str> = Vec::new();
    // What no epochs can say is said once.
    for clause in [&trend, &anomaly, &predicted, &past] {
        if !clauses.contains(&clause.as_str()) {
            clauses.push(clause);
        }
    }
    let sentence = fill(
        names.intro,
        &[
            ("n", &*count(found.epochs.len())),
            ("answers", &*clauses.join(texts.language.text("language.clause"))),
        ],
    );
    let with = |text: String, answer: &Answer| AnswerVerdict {
        text,
        answer: answer.clone(),
    };
    SeriesVerdict {
        sentence,
        as_predicted: with(predicted, &answers.as_predicted),
        as_in_the_past: with(past, &answers.as_in_the_past),
        trend: with(trend, &answers.trend),
        anomaly: with(anomaly, &answers.anomaly),
    }
}

/// Names the conditions of the newest epoch that lie beyond those of the others.
fn with_extrapolations(said: String, answer: &Answer, texts: &Texts) -> String {
    let names = &texts.series;
    let number = |v: f64| number(v, 1).replace('.', texts.decimal);
    let one = |found: &Extrapolation| match found.term {
        Term::Season => names.beyond_season.to_owned(),
        term => {
            let [low, high] = found.range.map(number);
            let values = [
                ("term", name(term, texts)),
                ("value", &*number(found.value)),
                ("low", &*low),
                ("high", &*high),
            ];
            fill(names.beyond, &values)
        }
    };
    let beyond: Vec<String> = answer.extrapolated.iter().map(one).collect();
    match beyond.is_empty() {
        true => said,
        false => format!("{said} ({})", beyond.join(", ")),
    }
}

/// `of_stones`: where stones are named; `of_none`: where none is.
fn in_words(answer: &Answer, of_stones: [&'static str; 2], of_none: &str, texts: &Texts) -> String {
    let names = &texts.series;
    let mm = |millimetres: f64| texts.mm(millimetres / 1e3);
    let named = answer.stones.len();
    let (length, low, high, id, epoch) = match &answer.largest {
        Some(d) => {
            let [low, high] = d.interval_mm.map(mm);
            (
                mm(d.length_mm),
                low,
                high,
                d.stone_id.to_string(),
                d.epoch.clone().unwrap_or_default(),
            )
        }
        None => Default::default(),
    };
    let values = [
        ("m", &*count(answer.tested)),
        ("length", &*length),
        ("low", &*low),
        ("high", &*high),
        ("id", &*id),
        ("epoch", &*epoch),
    ];
    let reason = match &answer.reason {
        None if named > 0 => return counted(of_stones, named, &values),
        None if answer.answer == Word::CannotTell => names.nothing_measured.to_owned(),
        None => {
            let half = answer.half_width_mm.map_or(String::new(), mm);
            return fill(of_none, &[("half", &*half)]);
        }
        Some(Unanswered::FewEpochs { have, need }) => fill(
            names.few_epochs,
            &[("have", &*count(*have)), ("need", &*count(*need))],
        ),
        Some(Unanswered::NothingMeasured) => names.nothing_measured.to_owned(),
        Some(Unanswered::GoesWith { term }) => {
            let stones = count(named);
            let values = [
                ("n", &*stones),
                ("length", &*length),
                ("id", &*id),
                ("term", name(*term, texts)),
            ];
            fill(names.may_be, &values)
        }
    };
    fill(names.cannot_tell, &[("reason", &*reason)])
}

/// Why the epochs cannot carry a term, in words; `epochs`: how many have a date.
pub fn inseparable_in_words(found: &Inseparable, epochs: usize, language: Language) -> String {
    let texts = Texts::of(language);
    let names = &texts.series;
    let (term, n) = (name(found.term, texts), count(epochs));
    match &found.why {
        WhyInseparable::NotGiven { epochs } => fill(
            names.not_given,
            &[("term", term), ("epochs", &*epochs.join(", "))],
        ),
        WhyInseparable::FewEpochs { have, need } => fill(
            names.too_few,
            &[("have", &*count(*have)), ("need", &*count(*need)), ("term", term)],
        ),
        WhyInseparable::Same if found.term == Term::Season => fill(names.same_season, &[("n", &*n)]),
        WhyInseparable::Same => fill(names.same, &[("n", &*n), ("term", term)]),
        WhyInseparable::TwoSeasons => fill(names.two_seasons, &[("n", &*n)]),
        WhyInseparable::GoesWith { other } => fill(
            names.goes_with,
            &[("n", &*n), ("term", term), ("other", name(*other, texts))],
        ),
    }
}

pub(crate) fn name(term: Term, texts: &Texts) -> &'static str {
    texts.series.terms[term as usize]
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_core::series::{Departure, SeriesAnswers};

    fn record(answers: SeriesAnswers) -> TrendsRecord {
        TrendsRecord {
            version: 1,
            epochs: vec!["a".to_owned(); 6],
            undated: Vec::new(),
            terms: vec![Term::Trend],
            basis: None,
            not_separable: Vec::new(),
            conditions: Vec::new(),
            variance_factors: None,
            wall: None,
            zones: Vec::new(),
            answers,
        }
    }

    #[test]
    fn the_four_answers_are_one_sentence() {
        let quiet = |answer| Answer {
            answer,
            tested: 180,
            half_width_mm: Some(0.2),
            ..Answer::default()
        };
        let trend = Answer {
            answer: Word::Yes,
            tested: 180,
            stones: vec![4, 412],
            largest: Some(Departure {
                stone_id: 412,
                length_mm: 2.0,
                interval_mm: [1.7, 2.3],
                epoch: None,
            }),
            ..Answer::default()
        };
        let answers = SeriesAnswers {
            as_predicted: quiet(Word::Yes),
            as_in_the_past: quiet(Word::Yes),
            trend,
            anomaly: quiet(Word::No),
        };
        let said = series_verdict(&record(answers.clone()), Language::English);
        assert_eq!(
            said.sentence,
            "Series of 6 epochs: trend: 2 of 180 stones move in proportion to time, the fastest by 2.0 mm a year (95 % interval 1.7 to \
             2.3 mm), stone 412; no stone moved abruptly; the newest epoch is as predicted; it continues the past."
        );
        let german = series_verdict(&record(answers), Language::German);
        assert!(german.sentence.contains("2,0 mm im Jahr"), "{}", german.sentence);
    }

    #[test]
    fn a_level_that_no_other_epoch_had_is_named() {
        let beyond = |term, value, range| Extrapolation { term, value, range };
        let answer = Answer {
            answer: Word::Yes,
            extrapolated: vec![
                beyond(Term::Level, 162.02, [152.76, 159.2]),
                beyond(Term::Season, 0.5, [0.2, 0.2]),
            ],
            ..Answer::default()
        };
        let answers = SeriesAnswers {
            as_predicted: answer,
            ..SeriesAnswers::default()
        };
        let said = series_verdict(&record(answers), Language::English);
        assert_eq!(
            said.as_predicted.text,
            "the newest epoch is as predicted (extrapolated: its level, 162.0, is outside the range of the other epochs, 152.8 to \
             159.2, extrapolated: no other epoch is within two months of its time of year)"
        );
    }

    #[test]
    fn what_cannot_be_told_is_said_once_with_its_reason() {
        let few = || Answer {
            reason: Some(Unanswered::FewEpochs { have: 3, need: 4 }),
            ..Answer::default()
        };
        let answers = SeriesAnswers {
            as_predicted: few(),
            as_in_the_past: few(),
            trend: few(),
            anomaly: few(),
        };
        let said = series_verdict(&record(answers), Language::English);
        assert_eq!(
            said.sentence,
            "Series of 6 epochs: cannot tell: it takes 4 epochs with a date, and there are 3."
        );
        let apart = Inseparable {
            term: Term::Season,
            why: WhyInseparable::GoesWith { other: Term::Level },
        };
        assert_eq!(
            inseparable_in_words(&apart, 6, Language::English),
            "6 epochs, in which season and level change together: they cannot be told apart"
        );
    }
}

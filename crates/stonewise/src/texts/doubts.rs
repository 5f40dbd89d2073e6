//! Doubts about a run as a whole: a run says them in English, a report in its own language.

use super::fill;
use crate::report_params::Language;

/// A doubt in both languages; words in braces are filled in.
#[derive(Debug)]
pub(crate) struct Doubt {
    /// As a run says it.
    pub english: &'static str,
    german: &'static str,
}

pub(crate) static NOT_CONVERGED: Doubt = Doubt {
    english: "the adjustment did not converge in {iterations} iterations, so its motions and their intervals must not be relied \
              on. Most often the clouds of one epoch do not fit its photos: run `stonewise check` on the project and look at its \
              pictures",
    german: "die Ausgleichung ist in {iterations} Iterationen nicht konvergiert, auf ihre Bewegungen und deren Intervalle ist kein \
             Verlass. Meist passen die Punktwolken einer Epoche nicht zu deren Fotos: `stonewise check` auf das Projekt anwenden und \
             die Bilder ansehen",
};

pub(crate) static BESIDE: Doubt = Doubt {
    english: "the cloud lies {length} mm ({along} along, {up} up) off the stones that the photos show, so stones are cut out of the \
              cloud beside their place, and their motions must not be relied on. Bring cameras and clouds into one frame; \
              `stonewise check` shows the edges of the cloud over a photo",
    german: "die Punktwolke liegt {length} mm ({along} längs, {up} hoch) neben den Steinen, die die Fotos zeigen; Steine sind also \
             neben ihrem Platz aus der Wolke geschnitten, auf ihre Bewegungen ist kein Verlass. Kameras und Punktwolken in ein \
             System bringen; `stonewise check` zeigt die Kanten der Wolke über einem Foto",
};

pub(crate) static BESIDE_COMPARED: Doubt = Doubt {
    english: "the cloud lies {length} mm ({along} along, {up} up) off the stones that the photos show, compared with epoch {first}, \
              so stones are cut out of the cloud beside their place, and their motions must not be relied on. Bring cameras and \
              clouds into one frame; `stonewise check` shows the edges of the cloud over a photo",
    german: "die Punktwolke liegt, verglichen mit der Epoche {first}, {length} mm ({along} längs, {up} hoch) neben den Steinen, die \
             die Fotos zeigen; Steine sind also neben ihrem Platz aus der Wolke geschnitten, auf ihre Bewegungen ist kein Verlass. \
             Kameras und Punktwolken in ein System bringen; `stonewise check` zeigt die Kanten der Wolke über einem Foto",
};

pub(crate) static FEW_MEASURED: Doubt = Doubt {
    english: "only {measured} of the {matched} stones found in both epochs could be measured ({reasons}). That no motion is shown for \
              the others does not mean that they did not move. Most often the clouds of an epoch do not fit its photos: run \
              `stonewise check` on the project and look at its pictures",
    german: "nur {measured} der {matched} Steine, die in beiden Epochen gefunden wurden, waren zu messen ({reasons}). Dass für die \
             anderen keine Bewegung gezeigt wird, heißt nicht, dass sie sich nicht bewegt haben. Meist passen die Punktwolken einer \
             Epoche nicht zu deren Fotos: `stonewise check` auf das Projekt anwenden und die Bilder ansehen",
};

pub(crate) static BLIND: Doubt = Doubt {
    english: "motions below about {limit} mm cannot be detected in the weakest direction, {excess} times what the spacing and the noise \
              of the points allow: a small motion would not be seen. Clouds, photos and masks probably do not fit each other; run \
              `stonewise check` on the project",
    german: "Bewegungen unter etwa {limit} mm sind in der schwächsten Richtung nicht nachweisbar, dem {excess}-Fachen dessen, was \
             Abstand und Rauschen der Punkte erlauben: eine kleine Bewegung wäre nicht zu sehen. Punktwolken, Fotos und Masken passen \
             wahrscheinlich nicht zueinander; `stonewise check` auf das Projekt anwenden",
};

/// All of them; the longer of two that begin alike first.
static ALL: [&Doubt; 5] = [&NOT_CONVERGED, &BESIDE_COMPARED, &BESIDE, &FEW_MEASURED, &BLIND];

/// A doubt as a run said it, in the language of a report; `None` where it has no words of that language.
pub(crate) fn doubt_in(language: Language, said: &str) -> Option<String> {
    match language {
        Language::English => Some(said.to_owned()),
        Language::German => ALL
            .iter()
            .find_map(|doubt| Some(fill(doubt.german, &values_of(doubt.english, said)?))),
    }
}

/// What the braces of `text` were filled with in `said`.
fn values_of<'a>(text: &'a str, said: &'a str) -> Option<Vec<(&'a str, &'a str)>> {
    let mut parts = text.split('{');
    let mut rest = said.strip_prefix(parts.next()?)?;
    let mut values = Vec::new();
    for part in parts {
        let (name, after) = part.split_once('}')?;
        let end = match after {
            "" => rest.len(),
            after => rest.find(after)?,
        };
        values.push((name, &rest[..end]));
        rest = &rest[end + after.len()..];
    }
    rest.is_empty().then_some(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_run_said_is_said_in_german_with_its_values() {
        for doubt in ALL {
            let names: Vec<&str> = doubt
                .english
                .split('{')
                .skip(1)
                .filter_map(|t| Some(t.split_once('}')?.0))
                .collect();
            let values: Vec<String> = (0..names.len()).map(|k| format!("<{k}>")).collect();
            let pairs: Vec<(&str, &str)> = names
                .iter()
                .zip(&values)
                .map(|(name, value)| (*name, value.as_str()))
                .collect();
            let said = fill(doubt.english, &pairs);
            let german = doubt_in(Language::German, &said).unwrap();
            assert!(
                values.iter().all(|v| german.contains(v)) && !german.contains('{'),
                "{german}"
            );
            assert_ne!(german, said);
            assert_eq!(doubt_in(Language::English, &said), Some(said));
        }
        assert_eq!(doubt_in(Language::German, "something else"), None);
    }
}

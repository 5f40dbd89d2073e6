//! What is checked of every pair of epochs, and against what.

use super::check::{Limit, Rule};
use crate::texts::{
    BESIDE, BLIND, FEW_MEASURED, MISREGISTERED_EPOCH, NOT_CONVERGED, PART_REFUSED, STRETCHED, TORN, TURNED,
    UNCOVERED,
};

pub(super) static SETTLED: Rule = Rule {
    what: [
        "adjustments that did not settle",
        "Ausgleichungen, die nicht zur Ruhe kamen",
    ],
    limit: Limit::AtMost(0.0),
    source: [
        "an adjustment has settled when at most a tenth of the stones still move",
        "eine Ausgleichung ist zur Ruhe gekommen, wenn sich höchstens ein Zehntel der Steine noch bewegt",
    ],
    message: &NOT_CONVERGED,
    remedy: [
        "Look at the pictures of `stonewise check`, and correct the coordinate system or the masks",
        "Die Bilder von `stonewise check` ansehen und Koordinatensystem oder Masken berichtigen",
    ],
};

pub(super) static MEASURED: Rule = Rule {
    what: [
        "measured share of the stones found in both epochs",
        "gemessener Anteil der Steine, die in beiden Epochen gefunden wurden",
    ],
    limit: Limit::AtLeast(0.5),
    source: [
        "below half, the measured stones do not speak for the wall",
        "unter der Hälfte stehen die gemessenen Steine nicht für die Mauer",
    ],
    message: &FEW_MEASURED,
    remedy: [
        "Correct the cause of the most frequent status of the stones",
        "Die Ursache des häufigsten Status der Steine beheben",
    ],
};

pub(super) static COVERED: Rule = Rule {
    what: [
        "share of the walls around the measured stones that these cover",
        "Anteil der Mauern um die gemessenen Steine, den diese bedecken",
    ],
    limit: Limit::AtLeast(0.1),
    source: [
        "below a tenth, the measured stones say nothing about the walls",
        "unter einem Zehntel sagen die gemessenen Steine nichts über die Mauern",
    ],
    message: &UNCOVERED,
    remedy: [
        "Look at the views in the report: if the wall is seen from behind, give a point in front of it, `[views] outside = \
         [x, y, z]`; if its stones do not show, give photos, or clouds with more points",
        "Die Ansichten im Bericht ansehen: ist die Mauer von hinten zu sehen, einen Punkt vor ihr angeben, `[views] outside = \
         [x, y, z]`; sind ihre Steine nicht zu erkennen, Fotos angeben oder Punktwolken mit mehr Punkten",
    ],
};

pub(super) static CONFIRMED: Rule = Rule {
    what: [
        "neighbouring stones of a part of the wall without a motion",
        "benachbarte Steine eines Teils der Mauer ohne Bewegung",
    ],
    limit: Limit::AtMost(9.0),
    source: [
        "mistakes of single masks explain fewer than ten",
        "Fehler einzelner Masken erklären weniger als zehn",
    ],
    message: &PART_REFUSED,
    remedy: [
        "Look at the part on site and in the clouds of both epochs",
        "Den Teil vor Ort und in den Punktwolken beider Epochen ansehen",
    ],
};

pub(super) static SENSITIVE: Rule = Rule {
    what: [
        "median limit of detection, in units of what spacing and noise of the points allow",
        "Median der Nachweisgrenzen, in Einheiten dessen, was Abstand und Rauschen der Punkte erlauben",
    ],
    limit: Limit::AtMost(100.0),
    source: [
        "beyond a hundred times, something other than noise hides the motions",
        "ab dem Hundertfachen verdeckt etwas anderes als Rauschen die Bewegungen",
    ],
    message: &BLIND,
    remedy: [
        "Correct cameras or masks, and run again",
        "Kameras oder Masken berichtigen und neu rechnen",
    ],
};

pub(super) static SMALL_ROTATION: Rule = Rule {
    what: [
        "error of motions linear in the rotation, in standard deviations of a typical stone",
        "Fehler von Bewegungen, die linear in der Drehung sind, in Standardabweichungen eines typischen Steins",
    ],
    limit: Limit::AtMost(1.0),
    source: [
        "a larger error is not contained in the standard deviations",
        "ein größerer Fehler ist in den Standardabweichungen nicht enthalten",
    ],
    message: &TURNED,
    remedy: [
        "Register the clouds of this epoch to those of the first, with their cameras, and run again",
        "Die Punktwolken dieser Epoche samt ihren Kameras auf die der ersten registrieren und neu rechnen",
    ],
};

/// One sound survey in a thousand fails.
pub(super) static AGREES: Rule = Rule {
    what: [
        "probability of the registration error that surfaces off the wall show",
        "Wahrscheinlichkeit des Registrierungsfehlers, den Flächen neben der Mauer zeigen",
    ],
    limit: Limit::AtLeast(1e-3),
    source: [
        "one sound survey in a thousand fails",
        "eine von tausend einwandfreien Aufnahmen fällt durch",
    ],
    message: &MISREGISTERED_EPOCH,
    remedy: [
        "If these surfaces did not move, set `auto_stable = true`, or name some of them under `[[registration.stable]]`. If \
         they did move, state the registration error as `epoch_error_m`",
        "Haben sich diese Flächen nicht bewegt, `auto_stable = true` setzen oder einige davon unter `[[registration.stable]]` \
         angeben. Haben sie sich bewegt, den Registrierungsfehler als `epoch_error_m` angeben",
    ],
};

pub(super) static SCALED: Rule = Rule {
    what: [
        "stretch of the wall, in units of what is explained",
        "Dehnung der Mauer, in Einheiten des Erklärbaren",
    ],
    limit: Limit::AtMost(1.0),
    source: [
        "temperature explains 0.3 mm per metre, instruments their error of scale",
        "Temperatur erklärt 0,3 mm je Meter, Instrumente ihren Maßstabsfehler",
    ],
    message: &STRETCHED,
    remedy: [
        "A known length in each epoch decides it: name it in `[[distances]]`. Check the scale of scanner and photogrammetric \
         block, and the map projection with its scale factor",
        "Eine bekannte Länge in jeder Epoche entscheidet es: sie gehört in `[[distances]]`. Den Maßstab von Scanner und \
         Bildverband und die Kartenprojektion mit ihrem Maßstabsfaktor prüfen",
    ],
};

pub(super) static IN_PLACE: Rule = Rule {
    what: [
        "distance between the stones of the photos and those of the cloud, m",
        "Abstand zwischen den Steinen der Fotos und denen der Punktwolke, m",
    ],
    limit: Limit::AtMost(0.03),
    source: ["a tenth of a small stone", "ein Zehntel eines kleinen Steins"],
    message: &BESIDE,
    remedy: [
        "Bring cameras and clouds into one frame; `stonewise check` shows the edges of the cloud over a photo",
        "Kameras und Punktwolken in ein System bringen; `stonewise check` zeigt die Kanten der Wolke über einem Foto",
    ],
};

/// Cameras in one frame with the cloud gave 0.94 to 0.99 (simulated) and 0.87 (the real photos of `fountain`); a focal
/// length wrong by a tenth gave 0.6, swapped axes gave 0.7.
pub(super) static AGREED: Rule = Rule {
    what: [
        "share of the photos' votes that a typical stone gets",
        "Anteil der Stimmen der Fotos, den ein typischer Stein erhält",
    ],
    limit: Limit::AtLeast(0.8),
    source: [
        "cameras that fit the cloud give 0.87 to 0.99, wrong ones 0.6 to 0.7",
        "Kameras, die zur Punktwolke passen, ergeben 0,87 bis 0,99, falsche 0,6 bis 0,7",
    ],
    message: &TORN,
    remedy: [
        "Check the camera file against the photos, then the masks",
        "Die Kameradatei mit den Fotos vergleichen, dann die Masken",
    ],
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rule_is_told_in_both_languages() {
        let all = [
            &SETTLED,
            &MEASURED,
            &COVERED,
            &CONFIRMED,
            &SENSITIVE,
            &SMALL_ROTATION,
            &AGREES,
            &SCALED,
            &IN_PLACE,
            &AGREED,
        ];
        for [english, german] in all.iter().flat_map(|rule| [rule.what, rule.source, rule.remedy]) {
            assert!(english != german && !english.ends_with('.') && !german.ends_with('.'));
        }
    }
}

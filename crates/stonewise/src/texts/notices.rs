//! What a run notes beside its results, and inputs that it left out.

use super::message::Message;

pub(crate) static INVALID_POINTS: Message = Message {
    english: "{n} points without finite coordinates are left out",
    german: "{n} Punkte ohne endliche Koordinaten sind weggelassen",
};

pub(crate) static AUTO_STABLE: Message = Message {
    english: "auto_stable: {count} areas off the wall are taken for stable, as far as they agree with each other",
    german: "auto_stable: {count} Flächen neben der Mauer gelten als stabil, soweit sie miteinander übereinstimmen",
};

pub(crate) static COULD_BE_STABLE: Message = Message {
    english: "{count} areas off the wall are seen in both epochs and could show their registration: auto_stable = true uses them all, \
              [[registration.stable]] those that you know did not move, such as corners = {corners}",
    german: "{count} Flächen neben der Mauer sind in beiden Epochen zu sehen und könnten deren Registrierung zeigen: auto_stable = true \
             verwendet alle, [[registration.stable]] die, von denen Sie wissen, dass sie sich nicht bewegt haben, zum Beispiel \
             corners = {corners}",
};

pub(crate) static MEAN_MOTION: Message = Message {
    english: "mean motion of the measured stones that are not loose, as measured: {mean} (standard deviations with the error of the \
              epochs' registration)",
    german: "mittlere Bewegung der gemessenen Steine, die nicht lose sind, wie gemessen: {mean} (Standardabweichungen mit dem \
             Registrierungsfehler der Epochen)",
};

pub(crate) static MEAN_MOTION_OF_UNKNOWN_DATUM: Message = Message {
    english: "mean motion of the measured stones that are not loose, as measured: {mean} (standard deviations without the error of the \
              epochs' registration, which is unknown)",
    german: "mittlere Bewegung der gemessenen Steine, die nicht lose sind, wie gemessen: {mean} (Standardabweichungen ohne den \
             Registrierungsfehler der Epochen, der unbekannt ist)",
};

pub(crate) static STABLE_MOVED: Message = Message {
    english: "[[registration.stable]] number {n} moved against the other stable areas and is left out",
    german: "[[registration.stable]] Nummer {n} hat sich gegen die anderen stabilen Flächen bewegt und ist weggelassen",
};

pub(crate) static OFF_WALL_MOVED: Message = Message {
    english: "auto_stable: the area off the wall around ({place}) moved against the other stable areas and is left out",
    german: "auto_stable: die Fläche neben der Mauer um ({place}) hat sich gegen die anderen stabilen Flächen bewegt und ist weggelassen",
};

pub(crate) static STABLE_TOO_FEW: Message = Message {
    english: "[[registration.stable]] does not show the epochs' registration: {cells} plane cells seen in both epochs are too few; it is \
              taken as unknown. Name areas with points in both epochs and faces in three directions, or state epoch_error_m",
    german: "[[registration.stable]] zeigt die Registrierung der Epochen nicht: {cells} ebene Zellen, die in beiden Epochen zu sehen sind, \
             sind zu wenige; sie gilt als unbekannt. Flächen mit Punkten in beiden Epochen und mit Seiten in drei Richtungen nennen, oder \
             epoch_error_m angeben",
};

pub(crate) static OFF_WALL_TOO_FEW: Message = Message {
    english: "auto_stable: surfaces off the wall do not show the epochs' registration: {cells} plane cells seen in both epochs are too few",
    german: "auto_stable: Flächen neben der Mauer zeigen die Registrierung der Epochen nicht: {cells} ebene Zellen, die in beiden Epochen zu \
             sehen sind, sind zu wenige",
};

pub(crate) static REGISTRATION_UNKNOWN: Message = Message {
    english: "the registration error of the epochs is unknown: limits, intervals and significance hold for motions against the \
              common rigid motion of the measured stones",
    german: "der Registrierungsfehler der Epochen ist unbekannt: Grenzen, Intervalle und Signifikanz gelten für Bewegungen gegen die \
             gemeinsame starre Bewegung der gemessenen Steine",
};

pub(crate) static NO_MASKS: Message = Message {
    english: "no masks for this photo in {file}",
    german: "keine Masken für dieses Foto in {file}",
};

pub(crate) static NO_CAMERA: Message = Message {
    english: "no camera in {file}; the photo is left out",
    german: "keine Kamera in {file}; das Foto ist weggelassen",
};

pub(crate) static UNUSABLE_CAMERA: Message = Message {
    english: "its camera cannot be used ({reason}) in {file}; the photo is left out",
    german: "seine Kamera in {file} ist nicht zu verwenden ({reason}); das Foto ist weggelassen",
};

pub(crate) static NO_SUCH_PHOTO: Message = Message {
    english: "camera not used: no such photo in {folder}",
    german: "Kamera nicht verwendet: kein solches Foto in {folder}",
};

pub(crate) static CAMERA_NOT_USED: Message = Message {
    english: "camera not used: {reason}",
    german: "Kamera nicht verwendet: {reason}",
};

/// Reasons as `stonewise-io` gives them.
static NOT_ALIGNED: Message = Message {
    english: "not aligned",
    german: "nicht ausgerichtet",
};

static DISABLED: Message = Message {
    english: "disabled in Metashape",
    german: "in Metashape abgeschaltet",
};

pub(crate) static PHOTO_NOT_TRACKED: Message = Message {
    english: "{error}: it does not help to measure stones",
    german: "{error}: es hilft nicht, Steine zu messen",
};

pub(crate) static PHOTO_NOT_SHOWN: Message = Message {
    english: "the photo cannot be shown in the report: {error}",
    german: "das Foto ist im Bericht nicht zu zeigen: {error}",
};

/// All of them; of two that fit the same words the more particular one first.
pub(super) static NOTICES: [&Message; 19] = [
    &INVALID_POINTS,
    &AUTO_STABLE,
    &COULD_BE_STABLE,
    &MEAN_MOTION,
    &MEAN_MOTION_OF_UNKNOWN_DATUM,
    &STABLE_MOVED,
    &OFF_WALL_MOVED,
    &STABLE_TOO_FEW,
    &OFF_WALL_TOO_FEW,
    &REGISTRATION_UNKNOWN,
    &NO_MASKS,
    &NO_CAMERA,
    &UNUSABLE_CAMERA,
    &NO_SUCH_PHOTO,
    &CAMERA_NOT_USED,
    &NOT_ALIGNED,
    &DISABLED,
    &PHOTO_NOT_TRACKED,
    &PHOTO_NOT_SHOWN,
];

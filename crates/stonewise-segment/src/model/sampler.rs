//! Which boxes a loss looks at.

use super::config::SamplingConfig;
use super::matcher::Match;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

/// Places of boxes drawn for a loss, in rising order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drawn {
    /// Boxes that stand for a stone, and the stone.
    pub positive: Vec<(usize, usize)>,
    /// Boxes that stand for background.
    pub negative: Vec<usize>,
}

/// Draws boxes by chance: positive ones up to their share, then negative ones until the count is full
/// (Girshick 2015, section 2.3). `takes_part` tells which background boxes may be drawn.
pub fn draw(
    matches: &[Match],
    config: &SamplingConfig,
    takes_part: impl Fn(usize) -> bool,
    rng: &mut ChaCha8Rng,
) -> Drawn {
    let mut drawn = Drawn::default();
    for (place, found) in matches.iter().enumerate() {
        match found {
            Match::Stone(stone) => drawn.positive.push((place, *stone)),
            Match::Background if takes_part(place) => drawn.negative.push(place),
            Match::Background | Match::Between => {}
        }
    }
    let most = (config.count as f32 * config.positive_share) as usize;
    keep_some(&mut drawn.positive, most, rng);
    keep_some(&mut drawn.negative, config.count - drawn.positive.len(), rng);
    drawn
}

fn keep_some<T: Copy + Ord>(items: &mut Vec<T>, count: usize, rng: &mut ChaCha8Rng) {
    if items.len() > count {
        let (kept, _) = items.partial_shuffle(rng, count);
        *items = kept.to_vec();
        items.sort_unstable();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn draws_the_asked_shares_and_fills_up_with_negatives() {
        let matches: Vec<Match> = (0..1000)
            .map(|i| match i % 4 {
                0 => Match::Stone(i),
                1 => Match::Between,
                _ => Match::Background,
            })
            .collect();
        let config = SamplingConfig {
            count: 64,
            positive_share: 0.25,
            positive_iou: 0.5,
            negative_iou: 0.5,
        };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let drawn = draw(&matches, &config, |place| place >= 500, &mut rng);
        assert_eq!((drawn.positive.len(), drawn.negative.len()), (16, 48));
        assert!(
            drawn
                .positive
                .iter()
                .all(|&(place, stone)| matches[place] == Match::Stone(stone))
        );
        assert!(
            drawn
                .negative
                .iter()
                .all(|&p| p >= 500 && matches[p] == Match::Background)
        );
        assert_eq!(
            drawn,
            draw(&matches, &config, |p| p >= 500, &mut ChaCha8Rng::seed_from_u64(1))
        );
        let few = draw(&matches[..8], &config, |_| true, &mut rng);
        assert_eq!((few.positive.len(), few.negative.len()), (2, 4));
    }
}

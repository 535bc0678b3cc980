use super::*;

/// Numbers of choices of the simulated wordings.
const CHOICES: [usize; 4] = [4, 4, 2, 4];

/// A simulated server with its model.
#[derive(Debug, Clone, Copy)]
enum Server {
    /// Answers by the image, right with this probability.
    Sees(f64),
    /// Guesses, with this probability of the first letter.
    Guesses(f64),
    /// Drops every n-th image, at random; the model sees the others.
    Drops(u64),
    /// Drops the images of every second request.
    DropsSecond,
}

/// Untouched images, each with all wordings, and what a server answers.
struct Run {
    random: SplitMix,
    server: Server,
    /// The reply to each wording without an image.
    by_words: [usize; 4],
    requests: usize,
}

impl Run {
    fn new(seed: u64, server: Server) -> Self {
        let mut random = SplitMix(seed);
        let by_words = CHOICES.map(|choices| draw(&mut random, choices));
        Self { random, server, by_words, requests: 0 }
    }

    fn next(&mut self) -> LitReply {
        let place = self.requests % CHOICES.len();
        self.requests += 1;
        let (choices, random) = (CHOICES[place], &mut self.random);
        let truth = draw(random, choices);
        let other = (truth + 1 + draw(random, choices - 1)) % choices;
        let is_dropped = match self.server {
            Server::Drops(nth) => random.bits().is_multiple_of(nth),
            Server::DropsSecond => self.requests.is_multiple_of(2),
            Server::Sees(_) | Server::Guesses(_) => false,
        };
        let chosen = match self.server {
            Server::Guesses(first) if uniform(random) < first => 0,
            Server::Guesses(_) => draw(random, choices),
            _ if is_dropped => self.by_words[place],
            Server::Sees(right) if uniform(random) >= right => other,
            Server::Drops(_) | Server::DropsSecond if uniform(random) >= 0.9 => other,
            _ => truth,
        };
        LitReply { wording: Digest::from_bytes(&[place as u8]), choices, truth, chosen }
    }

    /// The finding within this number of replies.
    fn found_within(mut self, replies: usize) -> Option<Independence> {
        let mut dependence = ImageDependence::default();
        (0..replies).find_map(|_| dependence.add(self.next()))
    }
}

fn draw(random: &mut SplitMix, below: usize) -> usize {
    (random.bits() % below as u64) as usize
}

fn uniform(random: &mut SplitMix) -> f64 {
    (random.bits() >> 11) as f64 / (1_u64 << 53) as f64
}

/// Number of runs of `replies` replies in which they are found to be independent of the image.
fn found(runs: u64, replies: usize, server: Server) -> usize {
    (0..runs)
        .map(|seed| Run::new(seed.wrapping_mul(0x1234_5679), server))
        .filter_map(|run| run.found_within(replies))
        .count()
}

#[test]
fn models_that_see_or_guess_are_rarely_named() {
    for server in [
        Server::Sees(1.0),
        Server::Sees(0.9),
        // The light part of a run with a model that gives one answer in the dark.
        Server::Sees(0.6),
        Server::Guesses(0.0),
        Server::Guesses(0.5),
    ] {
        let named = found(2_000, 400, server);
        assert!(named <= 20, "{server:?}: {named} of 2000");
    }
}

#[test]
fn a_server_that_drops_every_image_is_found_within_100_replies() {
    let named = found(1_000, 96, Server::Drops(1));
    assert!(named >= 950, "{named} of 1000");
}

#[test]
fn a_server_that_drops_every_second_image_is_found_within_400_replies() {
    // The first 128 of 400 trials are about untouched images.
    for server in [Server::Drops(2), Server::DropsSecond] {
        for (replies, least) in [(128, 320), (400, 360)] {
            let named = found(400, replies, server);
            assert!(named >= least, "{server:?}: {named} of 400 in {replies}");
        }
    }
}

#[test]
fn one_letter_is_told_from_dropped_images() {
    let found = Run::new(3, Server::Guesses(1.0)).found_within(100).unwrap();
    assert_eq!((found.extent, found.p), (Extent::OneLetter(0), None));
    assert!(found.words("m").starts_with("m answers A whatever the image and the question: "));
    let all = Run::new(3, Server::Drops(1)).found_within(100).unwrap();
    assert_eq!((all.extent, all.usual), (Extent::All, all.other_truth));
    assert!(all.p.unwrap() < 0.0005);
    let part = Run::new(3, Server::Drops(2)).found_within(400).unwrap();
    assert_eq!(part.extent, Extent::Part);
}

#[test]
fn one_reply_to_all_questions_with_as_many_choices_is_found() {
    let mut run = Run::new(1, Server::Drops(1));
    run.by_words = [0, 0, 1, 0];
    let found = run.found_within(96).unwrap();
    assert_eq!(found.extent, Extent::All);
}

#[test]
fn answers_that_are_true_of_all_images_are_no_sign() {
    let replies: Vec<LitReply> = (0..200)
        .map(|place| LitReply {
            wording: Digest::from_bytes(&[place % 4]),
            choices: 4,
            truth: usize::from(place % 4),
            chosen: usize::from(place % 4),
        })
        .collect();
    assert_eq!(Independence::find(&replies), None);
}

#[test]
fn the_finding_does_not_depend_on_the_order() {
    let mut run = Run::new(5, Server::Drops(1));
    let mut replies: Vec<LitReply> = (0..3_000).map(|_| run.next()).collect();
    let first = Independence::find(&replies).unwrap();
    replies.reverse();
    assert_eq!(Independence::find(&replies), Some(first));
}

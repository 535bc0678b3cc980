//! Finish reasons that the program does not know, decided by a second try: [`FinishWords`].
//!
//! A reply may end by a filter, a loop or a limit under any word of a vendor. At temperature 0 it would end so again:
//! it is the model's, and scored as unread. Or the server gave the generation up, and another try has the answer. The
//! first reply with an unknown word is therefore asked again, once; other replies with the same word wait for it. If it
//! ends by the same word, the word is taken for deliberate for the rest of the run, else for a generation that broke
//! off, and each reply with it is asked again. A trial that ended twice without an answer is the model's, whatever the
//! words. No trial is paid for more than twice. A resumed run learns its words again, for one more paid reply a word at
//! most: nothing besides the records is stored, and their words may come from another server.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use crate::failures::AskError;
use darkqa_base::types::{FailureKind, Finish, Reply};

/// What the second try of a reply showed about its finish reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SecondTry {
    /// The second try ended by the same word.
    Deliberate,
    /// The second try ended in another way.
    BrokenOff,
}

/// Result of the second try for one finish reason; `None` before it. Locked while the first reply is asked again.
type Word = Arc<tokio::sync::Mutex<Option<SecondTry>>>;

/// What second tries showed about the unknown finish reasons of one model.
#[derive(Debug, Default)]
pub(super) struct FinishWords(Mutex<HashMap<String, Word>>);

impl FinishWords {
    /// Returns a reply that counts, in place of one that may end in another way. `may_pay` is false if the question
    /// must not be paid for again; `ask_again` asks it once more.
    ///
    /// # Errors
    /// If the question was asked again without a reply, or the word means that the generation broke off and the
    /// question must not be paid for again.
    pub(super) async fn settle<F>(
        &self,
        first: Reply,
        may_pay: bool,
        ask_again: impl FnOnce() -> F,
    ) -> Result<Reply, AskError>
    where
        F: Future<Output = Result<Reply, AskError>>,
    {
        let Finish::Other(word) = first.finish.clone() else {
            // Thoughts without an answer.
            if !may_pay {
                return Ok(first);
            }
            return join(first, ask_again().await);
        };
        let known = self.word(&word);
        let mut verdict = known.lock().await;
        match *verdict {
            Some(SecondTry::BrokenOff) if may_pay => {
                drop(verdict);
                join(first, ask_again().await)
            }
            Some(SecondTry::BrokenOff) => Err(broken_off(&first, word)),
            None if may_pay => {
                let second = ask_again().await;
                *verdict = second.as_ref().ok().map(|second| match &second.finish {
                    Finish::Other(again) if *again == word => SecondTry::Deliberate,
                    _ => SecondTry::BrokenOff,
                });
                join(first, second)
            }
            // The model's own end, or nothing shows that another try would have an answer.
            Some(SecondTry::Deliberate) | None => Ok(first),
        }
    }

    /// The entry of a word.
    fn word(&self, word: &str) -> Word {
        let mut words = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(words.entry(Finish::normalized(word)).or_default())
    }
}

/// The result of a second try, with the attempts and the charge of the first.
fn join(first: Reply, second: Result<Reply, AskError>) -> Result<Reply, AskError> {
    let mut lost = first.lost;
    lost.add(first.usage);
    match second {
        Ok(second) => Ok(Reply { attempts: first.attempts + second.attempts, lost: lost.plus(second.lost), ..second }),
        Err(error) => {
            let word = match first.finish {
                Finish::Other(word) => Some(word),
                _ => None,
            };
            Err(AskError {
                attempts: first.attempts + error.attempts,
                lost: Box::new(lost.plus(*error.lost)),
                finish: error.finish.or(word.map(String::into_boxed_str)),
                ..error
            })
        }
    }
}

/// Error of a reply whose generation broke off, and which must not be paid for again.
fn broken_off(reply: &Reply, word: String) -> AskError {
    let message =
        format!("a reply that broke off: its finish_reason is {word:?}, and --retries paid allows no other try");
    let mut lost = reply.lost;
    lost.add(reply.usage);
    AskError {
        finish: Some(word.into_boxed_str()),
        ..AskError::new(FailureKind::Response, message).with_attempts(reply.attempts, lost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::types::Usage;

    fn ended(word: &str, text: &str) -> Reply {
        let finish = match word {
            "stop" => Finish::Stop,
            word => Finish::Other(word.to_owned()),
        };
        Reply {
            may_heal: finish != Finish::Stop,
            finish,
            usage: Some(Usage { prompt_tokens: Some(100), completion_tokens: Some(3), ..Usage::default() }),
            ..Reply::local(text.to_owned())
        }
    }

    /// Settles a first reply; `second` is the reply of a second try, `None` if there must be none.
    fn settle(words: &FinishWords, first: Reply, second: Option<Reply>) -> Result<Reply, AskError> {
        let runtime = tokio::runtime::Builder::new_current_thread().build();
        runtime.unwrap().block_on(words.settle(first, true, || async { Ok(second.expect("asked again")) }))
    }

    #[test]
    fn repeated_word_is_deliberate() {
        let words = FinishWords::default();
        let reply = settle(&words, ended("NO_IMAGE", ""), Some(ended("NO_IMAGE", ""))).unwrap();
        assert_eq!((reply.attempts, reply.lost.attempts), (2, 1));
        let next = settle(&words, ended("no_image", ""), None).unwrap();
        assert_eq!((next.attempts, next.lost.attempts), (1, 0));
    }

    #[test]
    fn healed_word_is_asked_again() {
        let words = FinishWords::default();
        for _ in 0..2 {
            let reply = settle(&words, ended("paused", "A"), Some(ended("stop", "B"))).unwrap();
            assert_eq!((&*reply.text, reply.attempts), ("B", 2));
        }
        // A trial that ends so twice is the model's.
        let reply = settle(&words, ended("paused", ""), Some(ended("paused", ""))).unwrap();
        assert_eq!(reply.finish, Finish::Other("paused".to_owned()));
    }

    #[test]
    fn failed_second_try_decides_nothing() {
        let words = FinishWords::default();
        let runtime = tokio::runtime::Builder::new_current_thread().build();
        let failed = runtime.unwrap().block_on(
            words.settle(ended("paused", ""), true, || async { Err(AskError::new(FailureKind::Server, "no".into())) }),
        );
        let error = failed.unwrap_err();
        assert_eq!((error.attempts, error.lost.attempts), (2, 1));
        assert_eq!(error.finish.as_deref(), Some("paused"));
        settle(&words, ended("paused", ""), Some(ended("paused", ""))).unwrap();
    }

    #[test]
    fn unpaid_second_try_is_not_made() {
        let words = FinishWords::default();
        let runtime = tokio::runtime::Builder::new_current_thread().build();
        let reply =
            runtime.unwrap().block_on(words.settle(ended("paused", ""), false, || async { panic!("asked again") }));
        assert_eq!(reply.unwrap().attempts, 1);
    }

    #[test]
    fn thoughts_without_an_answer_are_asked_again_once() {
        let words = FinishWords::default();
        for second in ["B", ""] {
            let first = Reply { may_heal: true, ..ended("stop", "") };
            let reply = settle(&words, first, Some(ended("stop", second))).unwrap();
            assert_eq!((&*reply.text, reply.attempts), (second, 2));
        }
    }
}

//! Parsing of a reply into the record of its trial, for both experiments: [`Detail`], [`answered`], [`reread`].

use crate::choice::llm_match::{Protocol, mark};
use crate::choice::option_probabilities::option_probabilities;
use crate::choice::{LENIENT_VERSION, has_thoughts, readings};
use darkqa_base::error::Result;
use darkqa_base::types::records::Record;
use darkqa_base::types::{
    Answer, ChoiceDetail, Choices, Finish, OpenDetail, OptionProbabilities, Reply, Step, StoredDetail, TrialOutcome,
    UnreadReason,
};

/// Part of a record that stores the answer parsed from a reply.
pub trait Detail: StoredDetail {
    /// Version of the parsing rules, such as `lenient/5`; `None` if no choice is parsed.
    const REPLY_READING: Option<&'static str>;

    /// Parses the answer in a reply and stores it. A stored reply can be parsed again.
    ///
    /// # Errors
    /// If the choices of the detail are not valid.
    fn read(&mut self, reply: &Reply) -> Result<()>;

    /// Index of the choice in the lenient parsing; `None` if no choice was found.
    fn chosen(&self) -> Option<usize>;

    /// Parses the line of a record. Each kind has its own function, so that this crate compiles it, for speed, and not
    /// the caller.
    ///
    /// # Errors
    /// If the line is not a record of this kind.
    fn parse_record(line: &[u8]) -> serde_json::Result<Record<Self>>;
}

impl Detail for ChoiceDetail {
    const REPLY_READING: Option<&'static str> = Some(LENIENT_VERSION);

    /// Stores both parsings of a reply, and the outcome, which follows from the strict parsing.
    fn read(&mut self, reply: &Reply) -> Result<()> {
        let why = self.strict.and_then(|strict| strict.why);
        if why == Some(UnreadReason::CannotTell) && reply.text.is_empty() {
            // A person pressed the button for it, so there is no text to parse again.
            return Ok(());
        }
        let choices = Choices::with_truth(self.choices.clone().into(), self.truth)?;
        let (strict, lenient) = readings(reply, &choices);
        self.outcome = match strict {
            Answer::Unparsed(_) => TrialOutcome::Unparsed,
            Answer::Chosen(index) => match choices.truth() {
                None => TrialOutcome::Answered,
                Some(truth) if truth == index => TrialOutcome::Right,
                Some(_) => TrialOutcome::Wrong,
            },
        };
        self.strict = Some(strict.into());
        self.lenient = Some(lenient.into());
        // A stored reply lacks the observer's findings and the probabilities of the choices, so the stored ones are
        // kept.
        if let Some(chances) = &reply.chances {
            let options = option_probabilities(chances, &self.choices);
            self.options = options.map(|options| OptionProbabilities {
                reasoned: options.reasoned || has_thoughts(&reply.text),
                ..options
            });
        }
        if reply.observed.is_some() {
            self.observed.clone_from(&reply.observed);
        }
        Ok(())
    }

    fn chosen(&self) -> Option<usize> {
        self.lenient?.chosen
    }

    fn parse_record(line: &[u8]) -> serde_json::Result<Record<Self>> {
        serde_json::from_slice(line)
    }
}

impl Detail for OpenDetail {
    const REPLY_READING: Option<&'static str> = None;

    /// Stores the marks that the two protocols parse from a judge's reply.
    fn read(&mut self, reply: &Reply) -> Result<()> {
        if self.step == Step::Mark {
            self.upstream = mark(&reply.text, Protocol::Upstream);
            self.tolerant = mark(&reply.text, Protocol::Tolerant);
        }
        Ok(())
    }

    fn chosen(&self) -> Option<usize> {
        None
    }

    fn parse_record(line: &[u8]) -> serde_json::Result<Record<Self>> {
        serde_json::from_slice(line)
    }
}

/// Returns the record with a reply and the answer parsed from it.
///
/// # Errors
/// If the choices of the record are not valid.
pub fn answered<D: Detail>(mut record: Record<D>, reply: Reply) -> Result<Record<D>> {
    read(&mut record, &reply)?;
    record.reply = Some(reply.text);
    record.refusal = reply.refusal;
    record.finish = Some(reply.finish);
    record.usage = reply.usage;
    record.served_model = reply.served_model;
    record.provider = reply.provider;
    record.endpoint = reply.endpoint;
    record.latency_ms = Some(reply.latency_ms);
    record.attempts = reply.attempts;
    record.lost = reply.lost;
    Ok(record)
}

/// Returns the record with its stored reply parsed again, by the rules of this version of the program.
///
/// # Errors
/// As for [`answered`].
pub fn reread<D: Detail>(mut record: Record<D>) -> Result<Record<D>> {
    if let Some(text) = record.reply.clone() {
        let reply = Reply {
            refusal: record.refusal.clone(),
            finish: record.finish.clone().unwrap_or(Finish::Unknown),
            ..Reply::local(text)
        };
        read(&mut record, &reply)?;
    }
    Ok(record)
}

fn read<D: Detail>(record: &mut Record<D>, reply: &Reply) -> Result<()> {
    let question = &record.question.0;
    record.detail.read(reply).map_err(|e| e.at(format!("the record of question {question:?}")))
}

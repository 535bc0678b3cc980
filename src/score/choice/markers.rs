//! Words that announce an answer, in many languages: [`markers`], [`lead`].
//!
//! The nouns include those of the multilingual patterns of OpenAI's simple-evals (`MULTILINGUAL_ANSWER_REGEXES`).

use std::sync::LazyLock;

use regex::Regex;

use super::text::Clauses;
use crate::choice::text::plain::compiled;
use crate::choice::text::tokens::Role;

/// The meaning of a marker for the choice that follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MarkerKind {
    /// "answer", "correct option": the choice that follows is the answer.
    Answer,
    /// "choose", "go with": a decision.
    Decision,
    /// "option", "letter": a choice is mentioned, perhaps not as the answer.
    Mention,
    /// "which leaves": the choice that follows is the answer.
    Remainder,
}

/// One marker in a text.
#[derive(Debug, Clone, Copy)]
pub(super) struct Marker {
    /// First byte of the marker.
    pub(super) start: usize,
    /// The byte after its last byte.
    pub(super) end: usize,
    pub(super) kind: MarkerKind,
}

static MARKER: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"(?P<answer>\b(?:answer|ans|antwort|lösung|réponse|reponse|respuesta|risposta|resposta|antwoord|ответ|ответом|відповідь",
        r"|odpowiedź|odpowiedzią|odpověď|cevap|cevabı|cevabım|yanıt|yanıtı|yanıtım|jawaban|jawapan|jibu|svar|svaret|vastaus|răspuns|răspunsul",
        r"|válasz|απάντηση|ìdáhùn|idáhùn|đáp án|trả lời|solution|solución|soluzione|solução)\b",
        r"|\b(?:correct|right|best|final|my|likely|suitable|appropriate|accurate)\s+(?:option|choice|selection|letter|pick|response|one)\b",
        r"|\b(?:richtige|korrekte) (?:option|wahl)\b|\b(?:opción|opção|opzione|option) (?:correcta|correta|corretta|correcte)\b|\bbonne option\b",
        r"|правильный вариант|doğru (?:seçenek|şık)",
        r"|الإجابة|الاجابة|الجواب|إجابة|جواب|پاسخ|תשובה|उत्तर|जवाब|উত্তর|பதில்|సమాధానం|જવાબ|คำตอบ",
        r"|答案|答え|答复|答復|答曰|解答|回答|正解|正确选项|正確選項|正しい選択肢|答|정답|답변|답안|답)",
        r"|(?P<decision>\b(?:choose|chose|select|selected|pick|picked|go(?:ing)? with|went with|opt(?:ing)? for|i'd say|i would say|wähle|choisis|elijo",
        r"|scelgo|escolho|kies|выбираю|wybieram|seçiyorum|i think it is|i think it's|i believe it is|i believe it's)\b|选择|選擇|应选|應選)",
        r"|(?P<mention>\b(?:option|choice|letter|selection|response|result|conclusion|verdict|prediction|output|label|wahl|choix|opción|opzione",
        r"|opção|optie|вариант|opcja|seçenek|şık)\b|الخيار|विकल्प|选项|選項|選択肢|보기|선택|选|選)"
    ))
});

/// Every marker of a text in lower case, from left to right.
pub(super) fn markers(folded: &str) -> impl Iterator<Item = Marker> {
    MARKER.captures_iter(folded).filter_map(|found| {
        let groups =
            [("answer", MarkerKind::Answer), ("decision", MarkerKind::Decision), ("mention", MarkerKind::Mention)];
        let (mark, kind) = groups.into_iter().find_map(|(name, kind)| Some((found.name(name)?, kind)))?;
        Some(Marker { start: mark.start(), end: mark.end(), kind })
    })
}

/// One of the words between a marker and the name of a choice.
static LEAD: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"\A[\s]*(?:(?P<colon>[:=]|=>|->|[→⇒⟶])",
        r"|(?P<link>(?:is|was|are|be|would|should|must|could|can|(?:would|should|must|will|could|may|might) be|(?:has|have|seems|appears) to be|seems|appears|becomes|being|ist|wäre|lautet|est|serait",
        r"|es|sería|è|sarebbe|é|seria|zou|to|jest|brzmi|это|este|je|är|er|on|là|adalah|ialah|είναι)\b|'s\b|[–—-]",
        r"|هي|هو|है|是|应该是|應該是|应为|應為|应选|應選|为|為|选|選|は|が|은|는|이|가|คือ|הוא|היא|است)",
        r"|(?P<fill>(?:option|choice|letter|answer|clearly|likely|probably|most|definitely|therefore|indeed|still|thus|simply|just|actually",
        r"|obviously|certainly|best|correct|that|it|it's|this|i think|i believe|i'd say|i would say|as follows|below|number|here|la|le|el|il|lo|o|die|der|das|de|het|lettre",
        r"|letra|lettera|buchstabe|opción|opção|opzione|optie|correcta|correcte|correta|corretta|finale|final|буква|вариант|opcja|şık|c'est|é a)\b",
        r"|الصحيحة|الصحيح|النهائية|النهائي|الحرف|الخيار|选项|選項|選択肢|보기|最终|最終))"
    ))
});

/// Articles and opening words between a label and a text.
static ARTICLE: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"\A[(\[]?(?:(?:it is|it's|this is|that is|that's|there is|there are)\s+)?",
        r"(?:(?:an?|the|in|on|un|une|le|la|les|el|los|las|il|lo|una?|uno|o|um|uma|der|die|das|ein|eine|de|het|een)\s+|l'|une )?"
    ))
});

/// Number of bytes of articles and opening words at the beginning of a text.
pub(super) fn article_length(folded: &str) -> usize {
    ARTICLE.find(folded).map_or(0, |found| found.end())
}

/// The words between a marker and the name that it announces.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Lead {
    /// Bytes at which the announced name may begin, in increasing order.
    pub(super) steps: Vec<usize>,
    /// True if the lead contains a verb or a colon, so that the name is stated to be the answer.
    pub(super) is_linked: bool,
    /// True if the lead contains a colon, so that all text after it is the answer.
    pub(super) has_colon: bool,
}

/// Maximum number of words between a marker and a name.
const MAX_LEAD_WORDS: usize = 12;

/// The lead after a marker that ends at byte `end`. Denials in it are skipped, because the state of the name contains
/// them.
pub(super) fn lead(clauses: &Clauses<'_>, end: usize) -> Lead {
    let folded = clauses.folded;
    let mut lead = Lead { steps: vec![past_space(folded, end)], is_linked: false, has_colon: false };
    let mut at = end;
    for _ in 0..MAX_LEAD_WORDS {
        let denial = clauses.element_at(at).filter(|word| word.roles.has_any(&[Role::Not, Role::Exclude]));
        if let Some(denial) = denial {
            at = denial.end;
            lead.is_linked = true;
            lead.steps.push(past_space(folded, at));
            continue;
        }
        let Some(found) = LEAD.captures(&folded[at..]) else {
            break;
        };
        let has_colon = found.name("colon").is_some();
        lead.has_colon |= has_colon;
        lead.is_linked |= has_colon || found.name("link").is_some();
        at += found.get(0).map_or(0, |whole| whole.end());
        lead.steps.push(past_space(folded, at));
    }
    lead
}

/// The first byte from `at` on that is not white space.
fn past_space(text: &str, at: usize) -> usize {
    text.len() - text[at..].trim_start().len()
}

static CONFIRMATION: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"\A[)\].]*\s*(?:is|seems|would be|must be|should be|appears to be|looks like)\s+",
        r"(?:(?:clearly|definitely|probably|likely|most|therefore|thus|also|indeed)\s+)*(?:the\s+|my\s+)?(?:most\s+|only\s+)?",
        r"(?:(?:correct|right|best|accurate|appropriate|suitable|likely|plausible|final)\s+(?:answer|option|choice|one|match|fit)",
        r"|answer)\b",
        r"|\A[)\].]*\s*(?:是|为|為)?(?:最)?(?:正确|正確)?(?:的)?(?:答案|选项|選項)|\A[)\].]*\s*が(?:正解|答え|正しい)",
        r"|\A[)\].]*\s*(?:가|이)\s*(?:정답|답)"
    ))
});

static LETTER_CONFIRMATION: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"\A[)\].]*\s*(?:is|seems|would be|must be)\s+(?:clearly |definitely |probably |most likely |likely )?(?:correct|right|best|true)\b",
        r"|\A[)\].]*\s+it (?:is|must be)(?:\z|[.,;!\n])|\A[)\].]*\s*(?:是)?(?:正确|正確|对的|對的)"
    ))
});

/// True if the text after a letter calls it the answer: "B is correct".
pub(super) fn confirms_letter(after: &str) -> bool {
    CONFIRMATION.is_match(after) || LETTER_CONFIRMATION.is_match(after)
}

/// True if the text after a choice's text calls it the answer: "kitchen is the best answer".
pub(super) fn confirms_text(after: &str) -> bool {
    CONFIRMATION.is_match(after)
}

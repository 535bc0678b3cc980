//! Recognition of replies that decline to answer. It decides only the reason that is reported for an unread reply.

use std::sync::LazyLock;

use regex::Regex;

use super::plain::compiled;

static REFUSAL: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"\bsorry\b|\bapologi[sz]e|\bas an ai\b|\bi'?m an ai\b|\b(?:can ?not|can't|could ?not|couldn't|unable to|not able to)\s+",
        r"(?:\w+\s+){0,2}?(?:help|assist|answer|see|view|tell|determine|identify|say|make|provide|discern|confirm|recogni[sz]e|comply|be determined|analy[sz]e)",
        r"|\b(?:impossible|not possible|hard|difficult) to (?:\w+\s+)?(?:tell|see|say|determine|identify|discern|answer)",
        r"|\btoo (?:dark|dim|blurry|noisy|unclear)\b|\b(?:completely|entirely|almost|nearly|totally) (?:black|dark)\b",
        r"|\bno (?:image|picture|idea|visible|clue)\b|\bnot (?:visible|sure|clear|certain|enough)\b|\bunclear\b|\bunsure\b",
        r"|\b(?:don't|do not|didn't|did not) (?:know|see|have)\b|\binsufficient\b|\bindeterminate\b|\bunanswerable\b|\bunknown\b",
        r"|无法|無法|抱歉|对不起|對不起|看不清|看不到|太暗|不能确定|不知道|わかりません|分かりません|見えません|見えない|暗すぎ|申し訳",
        r"|죄송|알 수 없|볼 수 없|어두워|모르겠|zu dunkel|leider|kann (?:\w+ ){0,3}nicht|tut mir leid|désolé|trop sombre|ne peux pas",
        r"|lo siento|no puedo|demasiado oscur|mi dispiace|non posso|troppo (?:scur|bui)|desculpe|não posso|muito escur|het spijt|te donker",
        r"|kan (?:\w+ ){0,3}niet|не могу|извините|простите|слишком темн|невозможно|آسف|لا أستطيع|لا يمكن|مظلم|क्षमा|माफ|अंधेर|नहीं देख",
        r"|üzgünüm|karanlık|przepraszam|nie mogę|zbyt ciemn"
    ))
});

/// True if a text in lower case declines to answer or states that nothing can be seen.
pub(crate) fn declines(folded: &str) -> bool {
    REFUSAL.is_match(folded)
}

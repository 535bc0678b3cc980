//! Asking, through the public interface and real connections.
use std::num::NonZeroU32;
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::snapshot::redacted;
use crate::support::table::check_rows;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use darkqa_base::types::{
    Choices, Digest, Evidence, FailureKind, Family, Finish, FrameId, Question, QuestionId, Reply, Rgb, View,
};
use darkqa_eval::internals::ask::{
    Access, BaseUrl, Call, Constrain, Endpoint, ExtraFields, ImageDetail, Message, Model, Parameters, Prompts, Query,
    Random, Remote, Script, Secret, Sending, SettingsOrigin, Temperature, TokenField, WireSetting,
};
use darkqa_pictures::Payload;
use darkqa_pictures::PayloadFormat;
use serde_json::json;

const KEY: &str = "sk-very-secret-0123";

fn quick() -> Sending {
    Sending { first_delay: Duration::from_millis(1), ..Sending::default() }
}

fn endpoint_at(base: &str, key: Option<&str>, sending: Sending) -> Arc<Endpoint> {
    let access = Access { key: key.map(|key| Secret::new(key, "KEY").unwrap()), ..Access::new(base.parse().unwrap()) };
    Arc::new(Endpoint::open(access, sending).unwrap())
}

fn model_at(mock: &MockEndpoint, sending: Sending) -> Remote {
    let endpoint = endpoint_at(&mock.base_url(), Some(KEY), sending);
    Remote::open(endpoint, Parameters::new("m".into())).unwrap()
}

fn image() -> Payload {
    let samples = (0..6 * 4 * 3).map(|i| i * 3).collect();
    Payload::encode(&Rgb::new(4, 6, samples).unwrap(), PayloadFormat::Png).unwrap()
}

fn question(id: &str, text: &str) -> Question {
    Question {
        id: QuestionId(id.into()),
        frame: FrameId("f".into()),
        family: Family::Presence,
        text: text.into(),
        choices: Choices::new(vec!["yes".into(), "no".into()], 0).unwrap(),
        group: None,
        evidence: Evidence::default(),
    }
}

#[tokio::test]
async fn request_is_smallest_every_server_takes() {
    let mock = MockEndpoint::start([Answer::text("B")]);
    let hostile = "say \"url\":\"\" \u{1F512} \\\"}}]}]} \n{{ x }}\u{0}";
    let images = [Arc::new(image())];
    let message = Message { images: &images, ..Message::text_only(hostile) };
    let reply = model_at(&mock, quick()).ask(message, 2).await.unwrap();
    assert_eq!((reply.text.as_str(), reply.attempts), ("B", 1));
    assert_eq!(reply.finish, Finish::Stop);
    assert_eq!(reply.served_model.as_deref(), Some("mock-1"));
    assert_eq!(reply.usage.unwrap().prompt_tokens, Some(90));

    let request = &mock.requests()[0];
    assert_eq!(request.line, "POST /v1/chat/completions HTTP/1.1");
    assert_eq!(request.header("authorization"), Some("Bearer sk-very-secret-0123"));
    assert_eq!(request.header("content-type"), Some("application/json"));
    let length = request.body.len().to_string();
    assert_eq!(request.header("content-length"), Some(length.as_str()));
    assert_eq!(request.header("transfer-encoding"), None);
    assert_eq!(request.header("accept-encoding"), Some("gzip"));

    let mut body = request.json();
    let url = body["messages"][0]["content"][1]["image_url"]["url"].take();
    let base64 = url.as_str().unwrap().strip_prefix("data:image/png;base64,").unwrap();
    let file = STANDARD.decode(base64).unwrap();
    assert_eq!(Digest::from_bytes(&file), images[0].facts().digest);
    let expected = json!({
        "model": "m", "temperature": 0.0, "max_tokens": 1024,
        "messages": [{"role": "user", "content": [
            {"type": "text", "text": hostile},
            {"type": "image_url", "image_url": {"url": null}},
        ]}],
    });
    assert_eq!(body, expected);
}

#[tokio::test]
async fn only_configured_settings_are_sent() {
    let mock = MockEndpoint::start([Answer::text("B")]);
    let endpoint = endpoint_at(&mock.base_url(), None, quick());
    let parameters = Parameters {
        model: "m".into(),
        temperature: Temperature::Server,
        top_p: Some(0.25),
        seed: Some(1234),
        max_tokens: NonZeroU32::new(16).unwrap(),
        first_max_tokens: None,
        token_field: TokenField::MaxCompletionTokens,
        reasoning_effort: Some("low".into()),
        thinking: None,
        detail: Some(ImageDetail::High),
        wire: WireSetting::Auto,
        constrain: Constrain::None,
        probabilities: false,
        extra: ExtraFields::default(),
        origin: SettingsOrigin::default(),
    };
    let model = Remote::open(endpoint.clone(), parameters).unwrap();
    let images = [image(), image()].map(Arc::new);
    let message = Message { images: &images, after: "\"url\":\"\" Red?", ..Message::text_only("Look \\\"url\":\"\"") };
    model.ask(message, 2).await.unwrap();
    let bare =
        Parameters { temperature: Temperature::Server, token_field: TokenField::Omit, ..Parameters::new("m".into()) };
    let model = Remote::open(endpoint, bare).unwrap();
    model.ask(Message::text_only("Red?"), 2).await.unwrap();

    let requests = mock.requests();
    assert_eq!(requests[0].header("authorization"), None);
    let body = requests[0].json();
    assert_eq!(body["messages"][0]["content"][1]["image_url"]["detail"], "high");
    assert_eq!(body["max_completion_tokens"], 16);
    assert_eq!(body["reasoning_effort"], "low");
    assert_eq!(body["top_p"], 0.25);
    assert_eq!(body["seed"], 1234);
    assert_eq!(body.as_object().unwrap().len(), 6);
    let parts = body["messages"][0]["content"].as_array().unwrap();
    assert_eq!(parts.len(), 4);
    assert_eq!(parts[0]["text"], message.before);
    assert_eq!(parts[1], parts[2]);
    assert!(parts[1]["image_url"]["url"].as_str().unwrap().len() > 100);
    assert_eq!(parts[3]["text"], message.after);
    let blind = json!({"model": "m", "messages": [{"role": "user", "content": "Red?"}]});
    assert_eq!(requests[1].json(), blind);
}

#[tokio::test]
async fn base_urls_keep_path_and_query() {
    let mock = MockEndpoint::start([Answer::text("B")]);
    let root = mock.base_url().replace("/v1", "");
    for (base, line) in [
        ("", "POST /chat/completions HTTP/1.1"),
        ("/openai/deployments/d/?api-version=1", "POST /openai/deployments/d/chat/completions?api-version=1 HTTP/1.1"),
    ] {
        let endpoint = endpoint_at(&format!("{root}{base}"), None, quick());
        let model = Remote::open(endpoint, Parameters::new("m".into())).unwrap();
        model.ask(Message::text_only("Red?"), 2).await.unwrap();
        assert_eq!(mock.requests().pop().unwrap().line, line);
    }
}

#[tokio::test]
async fn closed_port_is_connection_failure() {
    let port = {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        listener.local_addr().unwrap().port()
    };
    let sending = Sending { retries: 0, ..quick() };
    let endpoint = endpoint_at(&format!("http://127.0.0.1:{port}/v1"), None, sending);
    let model = Remote::open(endpoint, Parameters::new("m".into())).unwrap();
    let error = model.ask(Message::text_only("Red?"), 2).await.unwrap_err();
    assert_eq!(error.failure.kind, FailureKind::Connection);
    insta::assert_snapshot!(
        redacted(&error.failure.message.to_lowercase()),
        @"http://127.0.0.1:[PORT]/v1: error sending request: client error (connect): tcp connect error: [OS ERROR]"
    );
}

#[tokio::test]
async fn requested_wait_holds_for_all() {
    let limited = |name: &str, value: &str| Answer::error(429, "rate_limit_exceeded", "slow down").header(name, value);
    for answer in [limited("retry-after-ms", "50"), limited("retry-after", "0.05")] {
        let mock = MockEndpoint::start([answer, Answer::text("B")]);
        let model = model_at(&mock, quick());
        let start = Instant::now();
        assert_eq!(model.ask(Message::text_only("Red?"), 2).await.unwrap().attempts, 2);
        assert!(start.elapsed() >= Duration::from_millis(50));
    }
    // One request is turned away; another one, asked in the meanwhile, waits as well.
    let mock = MockEndpoint::start([limited("retry-after-ms", "80"), Answer::text("B")]);
    let endpoint = endpoint_at(&mock.base_url(), None, Sending { retries: 0, ..quick() });
    let first = Remote::open(endpoint.clone(), Parameters::new("m".into())).unwrap();
    let second = Remote::open(endpoint, Parameters::new("n".into())).unwrap();
    let start = Instant::now();
    let later = async {
        tokio::time::sleep(Duration::from_millis(40)).await;
        second.ask(Message::text_only("Red?"), 2).await.unwrap()
    };
    let (one, other) = tokio::join!(first.ask(Message::text_only("Red?"), 2), later);
    assert_eq!([one.unwrap().attempts, other.attempts], [2, 1]);
    assert!(start.elapsed() >= Duration::from_millis(80));
}

#[tokio::test]
async fn request_dropped_leaves_model_usable() {
    let mock = MockEndpoint::start([Answer::silent(), Answer::text("B")]);
    let model = model_at(&mock, quick());
    let asked = tokio::time::timeout(Duration::from_millis(50), model.ask(Message::text_only("Red?"), 2));
    assert!(asked.await.is_err());
    assert_eq!(model.ask(Message::text_only("Red?"), 2).await.unwrap().text, "B");
}

#[tokio::test]
async fn errors_and_debug_hide_keys() {
    let echo = format!("\u{1b}[31mIncorrect key: {KEY}, sent as Bearer {KEY}\n");
    for answer in [
        Answer::error(400, "x", &echo),
        Answer::new(418, echo.clone()),
        Answer::new(200, echo.clone()).header("x-should-retry", "false"),
        Answer::json(200, &json!({"choices": [{"error": {"message": echo, "code": 400}}]})),
        Answer::new(307, "").header("location", &format!("https://x.example/?k={KEY}")),
    ] {
        let mock = MockEndpoint::start([answer]);
        let model = model_at(&mock, Sending { retries: 0, ..quick() });
        let error = model.ask(Message::text_only("Red?"), 2).await.unwrap_err();
        let text = format!("{error:?} {error} {model:?}");
        assert!(!text.contains("sk-very"), "{text}");
        assert!(error.failure.message.contains("[secret]"), "{error}");
        assert!(!error.failure.message.contains(char::is_control));
        assert!(error.failure.message.len() < 500);
    }
    let mock = MockEndpoint::start([Answer::error(400, "x", "user us3r with passw0rd and t0ken, aks us3r:passw0rd")]);
    let base = mock.base_url().replace("//", "//us3r:passw0rd@") + "?token=t0ken";
    let model = Remote::open(endpoint_at(&base, None, quick()), Parameters::new("m".into())).unwrap();
    let error = model.ask(Message::text_only("Red?"), 2).await.unwrap_err();
    let text = format!("{error:?} {model:?}");
    check_rows(["us3r", "passw0rd", "t0ken"], |secret| {
        assert!(!error.failure.message.contains(secret), "{text}");
        assert!(!format!("{error:?}").contains(secret), "{text}");
    });
    let basic = mock.requests()[0].header("authorization").unwrap().to_owned();
    assert_eq!(basic, format!("Basic {}", STANDARD.encode("us3r:passw0rd")));
}

#[test]
fn keys_do_not_travel_in_open() {
    let key = Secret::new(KEY, "KEY").unwrap();
    let open = |base: &str, key: Option<&Secret>, allow_http| {
        let access = Access { key: key.cloned(), allow_http, ..Access::new(base.parse::<BaseUrl>().unwrap()) };
        Endpoint::open(access, quick())
    };
    let refused = open("http://10.0.0.7:8000/v1", Some(&key), false).unwrap_err();
    insta::assert_snapshot!(redacted(&refused.to_string()), @"
    --base-url: the key would be sent unencrypted to http://10.0.0.7:8000/v1; use https://, or --allow http on a
        network that you trust
    ");
    assert!(open("http://me:secret@10.0.0.7/v1", None, false).is_err());
    assert!(open("http://10.0.0.7:8000/v1", Some(&key), true).is_ok());
    assert!(open("http://10.0.0.7:8000/v1", None, false).is_ok());
    assert!(open("http://localhost:8000/v1", Some(&key), false).is_ok());
    assert!(open("https://api.example/v1", Some(&key), false).is_ok());
    assert!(open("https://me:secret@api.example/v1", Some(&key), false).is_err());
}

#[tokio::test]
async fn scripts_and_guesses_answer_without_endpoint() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("replies.jsonl");
    let condition = "L3-noise".parse().unwrap();
    let other = "L0".parse().unwrap();
    let asked = question("q1", "Red?");
    let prompt = Prompts::built_in(Prompts::DEFAULT).unwrap().render(View::Blind, &asked).unwrap();
    let call = |question, condition| Call {
        query: Query::Choice(question),
        condition,
        message: Message::text_only(&prompt),
        turn: 0,
    };
    std::fs::write(
        &path,
        "{\"question\":\"q1\",\"condition\":\"L3-noise\",\"reply\":\"A\"}\n\n{\"question\":\"q1\",\"reply\":\"B\"}\r\n{\"default\":\"C\"}",
    )
    .unwrap();
    let script = Model::Script(Script::load(&path).unwrap());
    let unknown = question("q2", "Red?");
    for (question, condition, said) in
        [(&asked, Some(&condition), "A"), (&asked, Some(&other), "B"), (&asked, None, "B"), (&unknown, None, "C")]
    {
        let reply = script.ask(call(question, condition)).await.unwrap();
        assert_eq!(reply, Reply::local(said.into()));
    }
    // Who only guesses letters knows nothing to say to an open question.
    let open = Call { query: Query::Open(&unknown.id), ..call(&asked, None) };
    assert_eq!(script.ask(open).await.unwrap().text, "C");
    let random = Model::Random(Random { seed: 1 });
    let error = random.ask(open).await.unwrap_err();
    insta::assert_snapshot!(redacted(&error.to_string()), @"question q2 has no choices, and this model can only choose");
    let reply = random.ask(call(&asked, None)).await.unwrap();
    assert!(["A", "B"].contains(&reply.text.as_str()));
    assert_eq!(random.name(), "random");
    let digest = |model: &Model| model.digest().unwrap();
    assert_ne!(digest(&random), digest(&Model::Random(Random { seed: 2 })));
    let endpoint = endpoint_at("http://127.0.0.1:1/v1", None, quick());
    let remote = Remote::open(endpoint, Parameters::new("m".into())).unwrap();
    let content = Model::Remote(Box::new(remote)).content();
    assert_eq!((&content["wire"], &content["model"]), (&json!("chat"), &json!("m")));

    std::fs::write(&path, "{\"question\":\"q1\",\"reply\":\"B\"}").unwrap();
    let script = Model::Script(Script::load(&path).unwrap());
    let error = script.ask(call(&unknown, None)).await.unwrap_err();
    assert_eq!(error.failure.kind, FailureKind::Request);
    insta::assert_snapshot!(
        redacted(&error.failure.message),
        @r#"[TMP]/replies.jsonl has no reply to question q2 and no {"default": ".."} line"#
    );
}

#[test]
fn broken_scripts_name_their_line() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("replies.jsonl");
    let good = r#"{"question":"q","reply":"B"}"#;
    let rows = [
        good,
        "nonsense",
        r#"{"question":"q"}"#,
        r#"{"reply":"B"}"#,
        r#"{"question":"q","reply":"B","default":"B"}"#,
        r#"{"condition":"L3-noise","default":"B"}"#,
        r#"{"question":"q","condition":"L9","reply":"B"}"#,
        r#"{"question":"q","answer":"B"}"#,
    ];
    check_rows(rows, |wrong| {
        std::fs::write(&path, format!("{good}\n\n{wrong}\n")).unwrap();
        let error = Script::load(&path).unwrap_err().to_string();
        assert!(error.contains("replies.jsonl, line 3: "), "{error}");
    });
    assert!(Script::load(dir.path()).is_err());
}

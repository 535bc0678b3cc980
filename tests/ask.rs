//! Asking, through the public interface and real connections.
#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use darkqa_eval::ask::{
    Access, AskError, BaseUrl, Call, Constrain, Detail, Endpoint, Format, Model, OpenAi,
    Parameters, Payload, Prompts, Random, Reach, Script, Secret, Sending, Temperature, TokenField,
};
use darkqa_eval::types::{
    Choices, Digest, FailureKind, Family, Finish, FrameId, Question, QuestionId, Reply, Rgb, View,
};
use serde_json::{Value, json};
use support::endpoint::{Answer, MockEndpoint};

const KEY: &str = "sk-very-secret-0123";

fn quick() -> Sending {
    Sending {
        first_delay: Duration::from_millis(1),
        ..Sending::default()
    }
}

fn endpoint_at(base: &str, key: Option<&str>, sending: Sending) -> Arc<Endpoint> {
    let access = Access {
        key: key.map(|key| Secret::new(key, "KEY").unwrap()),
        ..Access::new(base.parse().unwrap())
    };
    Arc::new(Endpoint::open(access, sending).unwrap())
}

fn model_at(mock: &MockEndpoint, sending: Sending) -> OpenAi {
    let endpoint = endpoint_at(&mock.base_url(), Some(KEY), sending);
    OpenAi::new(endpoint, Parameters::new("m".into()))
}

fn image() -> Payload {
    let samples = (0..6 * 4 * 3).map(|i| i * 3).collect();
    Payload::encode(&Rgb::new(4, 6, samples).unwrap(), Format::Png, None).unwrap()
}

fn question(id: &str, text: &str) -> Question {
    Question {
        id: QuestionId(id.into()),
        frame: FrameId("f".into()),
        family: Family::Presence,
        text: text.into(),
        choices: Choices::new(vec!["yes".into(), "no".into()], 0).unwrap(),
        evidence: Value::Null,
    }
}

/// Asks once, of an endpoint that plays these answers.
async fn asked(answers: Vec<Answer>) -> (Result<Reply, AskError>, MockEndpoint) {
    let mock = MockEndpoint::start(answers);
    let reply = model_at(&mock, quick())
        .ask("Red?", 2, Some(&image()))
        .await;
    (reply, mock)
}

#[tokio::test]
async fn a_request_is_the_smallest_every_server_takes() {
    let mock = MockEndpoint::start([Answer::text("B")]);
    let hostile = "say \"url\":\"\" \u{1F512} \\\"}}]}]} \n{{ x }}\u{0}";
    let image = image();
    let reply = model_at(&mock, quick())
        .ask(hostile, 2, Some(&image))
        .await
        .unwrap();
    assert_eq!((reply.text.as_str(), reply.attempts), ("B", 1));
    assert_eq!(reply.finish, Finish::Stop);
    assert_eq!(reply.served_model.as_deref(), Some("mock-1"));
    assert_eq!(reply.usage.unwrap().prompt_tokens, Some(90));

    let request = &mock.requests()[0];
    assert_eq!(request.line, "POST /v1/chat/completions HTTP/1.1");
    assert_eq!(
        request.header("authorization"),
        Some("Bearer sk-very-secret-0123")
    );
    assert_eq!(request.header("content-type"), Some("application/json"));
    let length = request.body.len().to_string();
    assert_eq!(request.header("content-length"), Some(length.as_str()));
    assert_eq!(request.header("transfer-encoding"), None);
    assert_eq!(request.header("accept-encoding"), Some("gzip"));

    let mut body = request.json();
    let url = body["messages"][0]["content"][1]["image_url"]["url"].take();
    let base64 = url
        .as_str()
        .unwrap()
        .strip_prefix("data:image/png;base64,")
        .unwrap();
    let file = STANDARD.decode(base64).unwrap();
    assert_eq!(Digest::of(&file), image.facts().digest);
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
async fn what_is_set_is_sent_and_what_is_not_is_left_out() {
    let mock = MockEndpoint::start([Answer::text("B")]);
    let endpoint = endpoint_at(&mock.base_url(), None, quick());
    let parameters = Parameters {
        model: "m".into(),
        temperature: Temperature::Server,
        max_tokens: Some(16),
        token_field: TokenField::MaxCompletionTokens,
        reasoning_effort: Some("low".into()),
        detail: Some(Detail::High),
        constrain: Constrain::None,
    };
    let model = OpenAi::new(endpoint.clone(), parameters);
    model.ask("Red?", 2, Some(&image())).await.unwrap();
    let bare = Parameters {
        temperature: Temperature::Server,
        max_tokens: None,
        ..Parameters::new("m".into())
    };
    let model = OpenAi::new(endpoint, bare);
    model.ask("Red?", 2, None).await.unwrap();

    let requests = mock.requests();
    assert_eq!(requests[0].header("authorization"), None);
    let body = requests[0].json();
    assert_eq!(
        body["messages"][0]["content"][1]["image_url"]["detail"],
        "high"
    );
    assert_eq!(body["max_completion_tokens"], 16);
    assert_eq!(body["reasoning_effort"], "low");
    assert_eq!(body.as_object().unwrap().len(), 4);
    let blind = json!({"model": "m", "messages": [{"role": "user", "content": "Red?"}]});
    assert_eq!(requests[1].json(), blind);
}

#[tokio::test]
async fn base_urls_keep_their_path_and_query() {
    let mock = MockEndpoint::start([Answer::text("B")]);
    let root = mock.base_url().replace("/v1", "");
    for (base, line) in [
        ("", "POST /chat/completions HTTP/1.1"),
        (
            "/openai/deployments/d/?api-version=1",
            "POST /openai/deployments/d/chat/completions?api-version=1 HTTP/1.1",
        ),
    ] {
        let endpoint = endpoint_at(&format!("{root}{base}"), None, quick());
        let model = OpenAi::new(endpoint, Parameters::new("m".into()));
        model.ask("Red?", 2, None).await.unwrap();
        assert_eq!(mock.requests().pop().unwrap().line, line);
    }
}

#[tokio::test]
async fn what_may_pass_is_tried_again() {
    let html = Answer::new(200, "<html><title>Sign in</title>").header("content-type", "text/html");
    let passing = [
        Answer::error(500, "x", "oops"),
        Answer::new(502, "<html>Bad gateway"),
        Answer::new(529, ""),
        Answer::new(408, ""),
        Answer::new(409, ""),
        Answer::error(429, "rate_limit_exceeded", "slow down"),
        Answer::dropped(),
        Answer::text("B").cut(20),
        Answer::new(200, "{\"choices\":["),
        Answer::new(200, ""),
        Answer::json(200, &json!({"choices": []})),
        Answer::json(200, &json!({"choices": null})),
        html,
        Answer::new(200, "data: {}\n\n").header("content-type", "text/event-stream"),
        Answer::new(499, ""),
        Answer::json(200, &json!({"error": {"message": "no", "code": 502}})),
        Answer::json(200, &json!({"error": "overloaded"})),
        Answer::error(400, "x", "odd").header("x-should-retry", "true"),
    ];
    for answer in passing {
        let (reply, mock) = asked(vec![answer.clone(), Answer::text("B")]).await;
        let reply = reply.unwrap_or_else(|error| panic!("{answer:?}: {error}"));
        assert_eq!(
            (reply.text.as_str(), reply.attempts),
            ("B", 2),
            "{answer:?}"
        );
        let requests = mock.requests();
        assert_eq!(requests[0].body, requests[1].body);
    }
}

#[tokio::test]
async fn retries_come_to_an_end() {
    for (answer, kind, status) in [
        (
            Answer::error(500, "x", "oops"),
            FailureKind::Server,
            Some(500),
        ),
        (
            Answer::error(429, "x", "slow"),
            FailureKind::RateLimit,
            Some(429),
        ),
        (
            Answer::new(200, "nonsense"),
            FailureKind::Response,
            Some(200),
        ),
        (Answer::dropped(), FailureKind::Connection, None),
        (Answer::text("B").cut(9), FailureKind::Connection, None),
        (
            Answer::json(200, &json!({"error": "x"})),
            FailureKind::Server,
            Some(200),
        ),
    ] {
        let mock = MockEndpoint::start([answer.clone()]);
        let sending = Sending {
            retries: 2,
            ..quick()
        };
        let error = model_at(&mock, sending)
            .ask("Red?", 2, None)
            .await
            .unwrap_err();
        assert_eq!(
            (error.failure.kind, error.failure.status),
            (kind, status),
            "{answer:?}"
        );
        assert_eq!((error.attempts, error.reach), (3, Reach::Trial));
        assert_eq!(mock.requests().len(), 3);
    }
}

#[tokio::test]
async fn what_will_not_pass_is_not_tried_again() {
    for (answer, reach, said) in [
        (
            Answer::error(400, "x", "bad image"),
            Reach::Trial,
            "bad image",
        ),
        (
            Answer::new(413, "<html><title>Too Large</title>"),
            Reach::Trial,
            "--max-side",
        ),
        (
            Answer::json(422, &json!({"detail": [{"msg": "field required"}]})),
            Reach::Trial,
            "field required",
        ),
        (
            Answer::error(401, "x", "no"),
            Reach::Endpoint,
            "--api-key-env",
        ),
        (Answer::error(402, "x", "pay"), Reach::Endpoint, "credit"),
        (Answer::error(403, "x", "no"), Reach::Endpoint, "key"),
        (
            Answer::json(
                403,
                &json!({"error": {"message": "no", "metadata": {"reasons": ["x"]}}}),
            ),
            Reach::Trial,
            "no",
        ),
        (Answer::new(404, ""), Reach::Endpoint, "--base-url"),
        (Answer::new(405, ""), Reach::Endpoint, "--base-url"),
        (
            Answer::new(307, "").header("location", "https://elsewhere.example/v1"),
            Reach::Endpoint,
            "elsewhere",
        ),
        (
            Answer::error(429, "insufficient_quota", "no quota"),
            Reach::Endpoint,
            "credit",
        ),
        (
            Answer::error(400, "model_not_found", "no such model"),
            Reach::Endpoint,
            "--model",
        ),
        (
            Answer::error(500, "x", "oops").header("x-should-retry", "false"),
            Reach::Trial,
            "oops",
        ),
        (
            Answer::json(
                400,
                &json!({"error": {"param": "temperature", "message": "only 1"}}),
            ),
            Reach::Endpoint,
            "--temperature default",
        ),
        (
            Answer::json(200, &json!({"error": {"message": "who?", "code": 401}})),
            Reach::Endpoint,
            "who?",
        ),
        (
            Answer::new(200, vec![b' '; (16 << 20) + 1]),
            Reach::Trial,
            "16 MiB",
        ),
    ] {
        let (reply, mock) = asked(vec![answer]).await;
        let error = reply.unwrap_err();
        assert_eq!((error.reach, error.attempts), (reach, 1), "{error}");
        assert!(error.failure.message.contains(said), "{error}");
        assert_eq!(mock.requests().len(), 1, "{error}");
    }
}

#[tokio::test]
async fn replies_without_an_answer_are_replies() {
    let refusal = json!({"content": null, "refusal": "I cannot see"});
    let (reply, _mock) = asked(vec![Answer::message(&refusal, "stop")]).await;
    let reply = reply.unwrap();
    assert_eq!(reply.text, "");
    assert_eq!(reply.refusal.as_deref(), Some("I cannot see"));
    for (finish, expected) in [
        ("length", Finish::Length),
        ("content_filter", Finish::Filter),
    ] {
        let thinking = json!({"content": null, "reasoning_content": "A? B?"});
        let (reply, _mock) = asked(vec![Answer::message(&thinking, finish)]).await;
        let reply = reply.unwrap();
        assert_eq!((reply.text.as_str(), reply.finish), ("", expected));
    }
}

#[tokio::test]
async fn servers_that_say_nothing_time_out() {
    for answer in [Answer::silent(), Answer::stuck()] {
        let mock = MockEndpoint::start([answer]);
        let sending = Sending {
            timeout: Duration::from_millis(60),
            retries: 1,
            ..quick()
        };
        let error = model_at(&mock, sending)
            .ask("Red?", 2, None)
            .await
            .unwrap_err();
        assert_eq!(error.failure.kind, FailureKind::Timeout);
        assert_eq!(error.attempts, 2);
        assert!(error.failure.message.contains("--timeout"), "{error}");
    }
}

#[tokio::test]
async fn a_closed_port_is_a_connection_failure() {
    let port = {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        listener.local_addr().unwrap().port()
    };
    let sending = Sending {
        retries: 0,
        ..quick()
    };
    let endpoint = endpoint_at(&format!("http://127.0.0.1:{port}/v1"), None, sending);
    let model = OpenAi::new(endpoint, Parameters::new("m".into()));
    let error = model.ask("Red?", 2, None).await.unwrap_err();
    assert_eq!(error.failure.kind, FailureKind::Connection);
    assert!(
        error.failure.message.to_lowercase().contains("refused"),
        "{error}"
    );
}

#[tokio::test]
async fn a_wait_asked_for_is_kept_by_all() {
    let limited = |name: &str, value: &str| {
        Answer::error(429, "rate_limit_exceeded", "slow down").header(name, value)
    };
    for answer in [
        limited("retry-after-ms", "50"),
        limited("retry-after", "0.05"),
    ] {
        let mock = MockEndpoint::start([answer, Answer::text("B")]);
        let model = model_at(&mock, quick());
        let start = Instant::now();
        assert_eq!(model.ask("Red?", 2, None).await.unwrap().attempts, 2);
        assert!(start.elapsed() >= Duration::from_millis(50));
    }
    // One request is turned away; another one, asked in the meanwhile, waits as well.
    let mock = MockEndpoint::start([limited("retry-after-ms", "80"), Answer::text("B")]);
    let endpoint = endpoint_at(
        &mock.base_url(),
        None,
        Sending {
            retries: 0,
            ..quick()
        },
    );
    let first = OpenAi::new(endpoint.clone(), Parameters::new("m".into()));
    let second = OpenAi::new(endpoint, Parameters::new("n".into()));
    let start = Instant::now();
    first.ask("Red?", 2, None).await.unwrap_err();
    let reply = second.ask("Red?", 2, None).await.unwrap();
    assert_eq!(reply.attempts, 1);
    assert!(start.elapsed() >= Duration::from_millis(80));
}

#[tokio::test]
async fn a_wait_too_long_is_given_up_at_once() {
    let tomorrow = SystemTime::now() + Duration::from_hours(24);
    for wait in ["600", "1e300", &httpdate::fmt_http_date(tomorrow)] {
        let answer = Answer::error(429, "x", "slow").header("retry-after", wait);
        let (reply, mock) = asked(vec![answer]).await;
        let error = reply.unwrap_err();
        assert!(error.failure.message.contains("--max-wait"), "{error}");
        assert_eq!((error.attempts, error.reach), (1, Reach::Endpoint));
        assert_eq!(mock.requests().len(), 1);
    }
}

#[tokio::test]
async fn a_request_dropped_leaves_the_model_usable() {
    let mock = MockEndpoint::start([Answer::silent(), Answer::text("B")]);
    let model = model_at(&mock, quick());
    let asked = tokio::time::timeout(Duration::from_millis(50), model.ask("Red?", 2, None));
    assert!(asked.await.is_err());
    assert_eq!(model.ask("Red?", 2, None).await.unwrap().text, "B");
}

#[tokio::test]
async fn keys_are_in_no_error_and_no_debug_output() {
    let echo = format!("\u{1b}[31mIncorrect key: {KEY}, sent as Bearer {KEY}\n");
    for answer in [
        Answer::error(400, "x", &echo),
        Answer::new(418, echo.clone()),
        Answer::new(200, echo.clone()).header("x-should-retry", "false"),
        Answer::json(
            200,
            &json!({"choices": [{"error": {"message": echo, "code": 400}}]}),
        ),
        Answer::new(307, "").header("location", &format!("https://x.example/?k={KEY}")),
    ] {
        let mock = MockEndpoint::start([answer]);
        let model = model_at(
            &mock,
            Sending {
                retries: 0,
                ..quick()
            },
        );
        let error = model.ask("Red?", 2, None).await.unwrap_err();
        let shown = format!("{error:?} {error} {model:?}");
        assert!(!shown.contains("sk-very"), "{shown}");
        assert!(error.failure.message.contains("[secret]"), "{error}");
        assert!(!error.failure.message.contains(char::is_control));
        assert!(error.failure.message.len() < 500);
    }
    let mock = MockEndpoint::start([Answer::error(
        400,
        "x",
        "user us3r with passw0rd and t0ken, aks us3r:passw0rd",
    )]);
    let base = mock.base_url().replace("//", "//us3r:passw0rd@") + "?token=t0ken";
    let model = OpenAi::new(
        endpoint_at(&base, None, quick()),
        Parameters::new("m".into()),
    );
    let error = model.ask("Red?", 2, None).await.unwrap_err();
    let shown = format!("{error:?} {model:?}");
    for secret in ["us3r", "passw0rd", "t0ken"] {
        assert!(!error.failure.message.contains(secret), "{shown}");
        assert!(!format!("{error:?}").contains(secret), "{shown}");
    }
    let basic = mock.requests()[0]
        .header("authorization")
        .unwrap()
        .to_owned();
    assert_eq!(basic, format!("Basic {}", STANDARD.encode("us3r:passw0rd")));
}

#[test]
fn keys_do_not_travel_in_the_open() {
    let key = Secret::new(KEY, "KEY").unwrap();
    let open = |base: &str, key: Option<&Secret>, allow_http| {
        let access = Access {
            key: key.cloned(),
            allow_http,
            ..Access::new(base.parse::<BaseUrl>().unwrap())
        };
        Endpoint::open(access, quick())
    };
    let refused = open("http://10.0.0.7:8000/v1", Some(&key), false).unwrap_err();
    assert!(refused.to_string().contains("--allow-http"), "{refused}");
    assert!(open("http://me:secret@10.0.0.7/v1", None, false).is_err());
    assert!(open("http://10.0.0.7:8000/v1", Some(&key), true).is_ok());
    assert!(open("http://10.0.0.7:8000/v1", None, false).is_ok());
    assert!(open("http://localhost:8000/v1", Some(&key), false).is_ok());
    assert!(open("https://api.example/v1", Some(&key), false).is_ok());
    assert!(open("https://me:secret@api.example/v1", Some(&key), false).is_err());
}

#[tokio::test]
async fn scripts_and_guesses_answer_without_an_endpoint() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("replies.jsonl");
    let condition = "L3-noise".parse().unwrap();
    let other = "L0".parse().unwrap();
    let asked = question("q1", "Red?");
    let prompt = Prompts::built_in()
        .unwrap()
        .render(View::Blind, &asked)
        .unwrap();
    let call = |question, condition| Call {
        question,
        condition,
        prompt: &prompt,
        image: None,
        turn: 0,
    };
    std::fs::write(
        &path,
        "{\"question\":\"q1\",\"condition\":\"L3-noise\",\"reply\":\"A\"}\n\n{\"question\":\"q1\",\"reply\":\"B\"}\r\n{\"default\":\"C\"}",
    )
    .unwrap();
    let script = Model::Script(Script::load(&path).unwrap());
    let unknown = question("q2", "Red?");
    for (question, condition, said) in [
        (&asked, Some(&condition), "A"),
        (&asked, Some(&other), "B"),
        (&asked, None, "B"),
        (&unknown, None, "C"),
    ] {
        let reply = script.ask(call(question, condition)).await.unwrap();
        assert_eq!(reply, Reply::local(said.into()));
    }
    let random = Model::Random(Random { seed: 1 });
    let reply = random.ask(call(&asked, None)).await.unwrap();
    assert!(["A", "B"].contains(&reply.text.as_str()));
    assert_eq!(random.name(), "random");
    assert_ne!(random.digest(), Model::Random(Random { seed: 2 }).digest());

    std::fs::write(&path, "{\"question\":\"q1\",\"reply\":\"B\"}").unwrap();
    let script = Model::Script(Script::load(&path).unwrap());
    let error = script.ask(call(&unknown, None)).await.unwrap_err();
    assert_eq!(error.failure.kind, FailureKind::Request);
    assert!(error.failure.message.contains("replies.jsonl"), "{error}");
    assert!(error.failure.message.contains("q2"), "{error}");
}

#[test]
fn broken_scripts_are_named_with_their_line() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("replies.jsonl");
    let good = r#"{"question":"q","reply":"B"}"#;
    for wrong in [
        good,
        "nonsense",
        r#"{"question":"q"}"#,
        r#"{"reply":"B"}"#,
        r#"{"question":"q","reply":"B","default":"B"}"#,
        r#"{"condition":"L3-noise","default":"B"}"#,
        r#"{"question":"q","condition":"L9","reply":"B"}"#,
        r#"{"question":"q","answer":"B"}"#,
    ] {
        std::fs::write(&path, format!("{good}\n\n{wrong}\n")).unwrap();
        let error = Script::load(&path).unwrap_err().to_string();
        assert!(error.contains("replies.jsonl, line 3: "), "{error}");
    }
    assert!(Script::load(dir.path()).is_err());
}

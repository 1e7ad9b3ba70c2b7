//! Renaming of topics.

use gridweave_runtime::stage::match_robot;
use std::str::FromStr;

/// A topic rename, written `OLD=NEW`. `{robot}` matches one part of both.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TopicRename {
    old: String,
    new: String,
}

impl TopicRename {
    /// The new name of `topic`, if it matches.
    pub fn apply(&self, topic: &str) -> Option<String> {
        match match_robot(&self.old, topic) {
            Some(robot) => Some(self.new.replace("{robot}", robot)),
            None => (self.old == topic).then(|| self.new.clone()),
        }
    }
}

impl FromStr for TopicRename {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = |what: &str| format!("`{text}` is not a topic rename: {what}; write it as in /slam/map=/map");
        let (old, new) = text.split_once('=').ok_or_else(|| wrong("there is no `=`"))?;
        if let Some(topic) = [old, new].iter().find(|topic| !topic.starts_with('/') || topic.len() < 2) {
            return Err(wrong(&format!("`{topic}` does not begin with `/` and a name")));
        }
        if new.contains("{robot}") && !old.contains("{robot}") {
            return Err(wrong("the first topic has no `{robot}`"));
        }
        Ok(Self { old: old.to_owned(), new: new.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn apply(rename: &str, topic: &str) -> Option<String> {
        rename.parse::<TopicRename>().unwrap().apply(topic)
    }

    #[test]
    fn a_topic_gets_its_name_and_others_keep_theirs() {
        assert_eq!(apply("/slam/map=/map", "/slam/map").as_deref(), Some("/map"));
        assert_eq!(apply("/slam/map=/map", "/slam/map2"), None);
        assert_eq!(apply("/{robot}/slam/map=/{robot}/map", "/r2/slam/map").as_deref(), Some("/r2/map"));
        assert_eq!(apply("/{robot}/slam/map=/{robot}/map", "/slam/map"), None);
    }

    #[test]
    fn an_invalid_rename_is_an_error_with_the_reason() {
        for (text, why) in [("/map", "no `=`"), ("map=/a", "`map`"), ("/a=/", "`/`"), ("/a=/{robot}/a", "`{robot}`")] {
            let error = text.parse::<TopicRename>().unwrap_err();
            assert!(error.contains(why) && error.contains(text), "{error}");
        }
    }
}

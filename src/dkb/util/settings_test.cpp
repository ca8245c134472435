// SPDX-License-Identifier: Apache-2.0
#include "dkb/util/settings.h"

#include <gtest/gtest.h>

#include <cmath>

#include "dkb/util/errors.h"
#include "dkb/util/random.h"
#include "dkb/util/test_errors.h"

namespace dkb {
namespace {

enum class Colour { red, green };

struct Options {
  bool on = true;
  int count = 1000;
  uint64_t seed = 1;
  double gain = 0.1;
  double scale = 1.2;
  Colour colour = Colour::green;
};

void bind(Settings* s, Options* o) {
  s->bind("features.count", &o->count, "[1] features per frame");
  s->bind("features.scale", &o->scale, "[1] between levels");
  s->bind("features.on", &o->on, "");
  s->bind("seed", &o->seed, "of all randomness");
  s->bind("filter.flow.gain", &o->gain, "[px]");
  s->bind("filter.colour", &o->colour, "colour", {{"red", Colour::red}, {"green", Colour::green}});
}

TEST(NearestName, FindsMisspellingsAndRefusesStrangers) {
  const std::vector<std::string> names{"depth_factor", "features.count", "fx", "fy"};
  EXPECT_EQ(nearest_name("depth_factr", names), "depth_factor");
  EXPECT_EQ(nearest_name("featurs.count", names), "features.count");
  EXPECT_EQ(nearest_name("fxx", names), "fx");
  EXPECT_EQ(nearest_name("fz", names), "") << "fx and fy are as near";
  EXPECT_EQ(nearest_name("foo", {"yolo", "loop", "none"}), "");
  EXPECT_EQ(nearest_name("fr9", {"fr1", "fr2", "fr3", "bonn"}), "");
  EXPECT_EQ(nearest_name("motoin", {"motion"}), "motion");
  EXPECT_EQ(nearest_name("rbg", {"rgb", "bgr"}), "rgb") << "neighbours that changed places";
  EXPECT_EQ(nearest_name("banana", names), "");
  EXPECT_EQ(nearest_name("", names), "");
}

TEST(Settings, SetEveryTypeByName) {
  Options o;
  Settings s;
  bind(&s, &o);
  s.set("features.on", "false", "--set");
  s.set("features.count", "-7", "--set");
  s.set("features.scale", "1e-3", "--set");
  s.set("seed", "18446744073709551615", "--set");
  s.set("filter.flow.gain", "2.5", "--set");
  s.set("filter.colour", "red", "--set");
  EXPECT_FALSE(o.on);
  EXPECT_EQ(o.count, -7);
  EXPECT_EQ(o.scale, 1e-3);
  EXPECT_EQ(o.seed, 18446744073709551615ull);
  EXPECT_EQ(o.gain, 2.5);
  EXPECT_EQ(o.colour, Colour::red);
  EXPECT_EQ(s.where("seed"), "--set");
}

TEST(Settings, MessagesNameKeyValueTypeAndNearestKey) {
  Options o;
  Settings s;
  bind(&s, &o);
  EXPECT_EQ(test::input_error_of([&] { s.set("featurs.count", "5", "--set"); }),
            "--set: unknown key \"featurs.count\" (did you mean \"features.count\"?)");
  EXPECT_EQ(test::input_error_of([&] { s.set("features.count", "5.5", "--set"); }),
            "--set: features.count: \"5.5\" is not a whole number");
  EXPECT_EQ(test::input_error_of([&] { s.set("features.scale", "nan", "--set"); }),
            "--set: features.scale: \"nan\" is not a number");
  EXPECT_EQ(test::input_error_of([&] { s.set("features.scale", "", "--set"); }),
            "--set: features.scale: \"\" is not a number");
  EXPECT_EQ(test::input_error_of([&] { s.set("features.count", "99999999999", "--set"); }),
            "--set: features.count: \"99999999999\" is not a whole number");
  EXPECT_EQ(test::input_error_of([&] { s.set("filter.colour", "blue", "--set"); }),
            "--set: filter.colour: \"blue\" is not one of red, green");
  EXPECT_EQ(test::input_error_of([&] { s.set("features.on", "1", "--set"); }),
            "--set: features.on: \"1\" is not true or false");
  EXPECT_EQ(test::input_error_of([&] { split_assignment("features.on", "--set"); }),
            "--set: \"features.on\" has no value; write key=value");
  EXPECT_EQ(o.count, 1000) << "a refused value leaves the field alone";
}

TEST(Settings, ValuesOutOfRangeAreRefusedAndTheFieldKept) {
  int count = 5;
  double share = 0.5, factor = 2;
  Settings s;
  s.bind("count", &count, "[features]", {.min = 1});
  s.bind("share", &share, "", {0, 1});
  s.bind("factor", &factor, "", {.min = 0, .above_min = true});
  EXPECT_EQ(test::input_error_of([&] { s.set("count", "0", "--set"); }),
            "--set: count: 0 is out of range; it must be at least 1");
  EXPECT_EQ(test::input_error_of([&] { s.set("share", "1.5", "a.yaml:3"); }),
            "a.yaml:3: share: 1.5 is out of range; it must be 0 ... 1");
  EXPECT_EQ(test::input_error_of([&] { s.set("factor", "0", "--set"); }),
            "--set: factor: 0 is out of range; it must be above 0");
  EXPECT_EQ(count, 5);
  EXPECT_EQ(share, 0.5);
  EXPECT_NO_THROW(s.check());
  factor = std::nan("");
  EXPECT_THROW(s.check(), InvalidOption);
}

TEST(Settings, YamlMayBeNestedOrDottedAndNamesFileAndLine) {
  Options o;
  Settings s;
  bind(&s, &o);
  s.load_yaml_text("# comment\nfeatures:\n  count: 5\nfilter.flow.gain: 3\nfilter:\n  colour: red\r\n", "a.yaml");
  EXPECT_EQ(o.count, 5);
  EXPECT_EQ(o.gain, 3.0);
  EXPECT_EQ(o.colour, Colour::red);
  EXPECT_EQ(s.where("features.count"), "a.yaml:3");
  s.load_yaml_text("", "empty.yaml");
  s.load_yaml_text("features:\n#  count: 3\n", "commented.yaml");
  const auto load = [&](const std::string& text) {
    return test::input_error_of([&] { s.load_yaml_text(text, "a.yaml"); });
  };
  EXPECT_EQ(load("seed: 3\nfeatures:\n  coun: 5\n"),
            "a.yaml:3: unknown key \"features.coun\" (did you mean \"features.count\"?)");
  EXPECT_EQ(load("features: 3"), "a.yaml:1: features: must be lines of the form `key: value`");
  EXPECT_EQ(load("seed: 1\nseed: 2"), "a.yaml:2: seed: is given twice; leave one out");
  EXPECT_EQ(load("features: {count: 1}\nfeatures.count: 2"), "a.yaml:2: features.count: is given twice; leave one out");
  EXPECT_EQ(load("seed:\n"), "a.yaml:1: seed: has no value; it must be a whole number, not negative");
  EXPECT_EQ(load("seed: [1, 2]"), "a.yaml:1: seed: has no value; it must be a whole number, not negative");
  EXPECT_EQ(load("seed: x"), "a.yaml:1: seed: \"x\" is not a whole number, not negative");
  EXPECT_EQ(load("[1, 2]"), "a.yaml:1: must be lines of the form `key: value`");
  EXPECT_EQ(load("a: &x {b: *x}").substr(0, 26), "a.yaml:1: unknown key \"a\"");
  EXPECT_EQ(load("{{{").substr(0, 8), "a.yaml:1");
}

TEST(Settings, WrittenYamlReadsBackTheSame) {
  Options o;
  o.gain = 0.1;
  o.scale = 1.0 / 3.0;
  Settings s;
  bind(&s, &o);
  const std::string text = s.to_yaml();
  EXPECT_EQ(text,
            "features:\n"
            "  count: 1000  # [1] features per frame\n"
            "  on: true\n"
            "  scale: 0.3333333333333333  # [1] between levels\n"
            "filter:\n"
            "  colour: green  # colour\n"
            "  flow:\n"
            "    gain: 0.1  # [px]\n"
            "seed: 1  # of all randomness\n");
  Options back;
  back.scale = 0, back.gain = 0, back.count = 0;
  Settings reader;
  bind(&reader, &back);
  reader.load_yaml_text(text, "config.yaml");
  EXPECT_EQ(back.scale, o.scale);
  EXPECT_EQ(back.gain, o.gain);
  EXPECT_EQ(reader.to_yaml(), text);
}

TEST(Settings, KeysThatClashAreAProgrammingError) {
  Options o;
  Settings s;
  bind(&s, &o);
  EXPECT_THROW(s.bind("seed", &o.count, ""), std::logic_error);
  EXPECT_THROW(s.bind("features", &o.count, ""), std::logic_error);
  EXPECT_THROW(s.bind("seed.x", &o.count, ""), std::logic_error);
}

TEST(Settings, MutatedYamlThrowsNothingButInputErrors) {
  const std::string original =
      Settings().to_yaml() +
      "# file\nfeatures:\n  count: 5\n  on: true\n  scale: 1.5\nfilter: {flow: {gain: 2}, colour: red}\n"
      "seed: 3\n";
  const std::string alphabet = "{}[]:,&*!|>'\"%@`#-?~ \n\t\r\\<0aZ.\xFF\x01";
  Random random(11);
  for (int i = 0; i < 4000; ++i) {
    std::string text = original;
    for (uint32_t n = 1 + random.below(6); n > 0 && !text.empty(); --n) {
      const size_t at = random.below(static_cast<uint32_t>(text.size()));
      const char c = alphabet[random.below(static_cast<uint32_t>(alphabet.size()))];
      switch (random.below(4)) {
        case 0:
          text[at] = c;
          break;
        case 1:
          text.insert(at, 1 + random.below(3), c);
          break;
        case 2:
          text.erase(at, 1 + random.below(8));
          break;
        default:
          text.resize(at);
      }
    }
    Options o;
    Settings s;
    bind(&s, &o);
    try {
      s.load_yaml_text(text, "m.yaml");
    } catch (const InputError& e) {
      EXPECT_EQ(std::string(e.what()).substr(0, 6), "m.yaml") << text;
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << text;
    }
  }
}

}  // namespace
}  // namespace dkb

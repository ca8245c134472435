// SPDX-License-Identifier: Apache-2.0
#include "bench/bench_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "bench/bench_plots.h"
#include "bench/text_table.h"
#include "dkb/dataset/trajectory_file.h"
#include "dkb/evaluation/svg_drawing.h"
#include "dkb/util/files.h"

namespace dkb::bench {
namespace {

const std::string kNone = "n/a";

// A section of the report, written alike as Markdown and as HTML.
struct Section {
  std::string title;
  std::vector<std::string> paragraphs;
  std::vector<TextTable> tables;
  std::vector<std::string> plots;
};

std::string metres(double value) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value, value < 0.01 ? 5 : 4) : kNone;
}
std::string interval_text(const MedianInterval& m, const std::function<std::string(double)>& text) {
  return m.known ? "[" + text(m.interval.low) + ", " + text(m.interval.high) + "]" : "";
}
double worst(const std::vector<double>& values) {
  return values.empty() ? std::nan("") : *std::max_element(values.begin(), values.end());
}
std::string number(const std::vector<double>& values, int decimals) {
  return values.empty() ? kNone : fmt::format("{:.{}f}", median_of(values), decimals);
}
std::string joined(const std::vector<std::string>& words) {
  std::string out;
  for (const std::string& w : words) out += (out.empty() ? "" : ", ") + w;
  return out.empty() ? "none" : out;
}

const SuiteSequence& sequence_of(const Results& r, const Cell& c) {
  return r.suite->sequences[c.sequence];
}
const SuiteVariant& variant_of(const Results& r, const Cell& c) {
  return r.suite->variants[c.variant];
}
bool any_run(const Results& r, size_t sequence) {
  return std::any_of(r.cells.begin(), r.cells.end(),
                     [&](const Cell& c) { return c.sequence == sequence && c.any_run(); });
}

double most_scored(const Results& r, size_t sequence) {
  double most = 0;
  for (const Cell& c : r.cells)
    if (c.sequence == sequence) most = std::max(most, c.scored());
  return most;
}

// `most`: the largest share that any variant scored.
std::string ape_cell(const Cell& c, double most) {
  if (!c.any_run()) return "not run";
  const std::vector<double> ape = c.ape();
  std::string text;
  if (!ape.empty()) {
    const MedianInterval m = median_interval(ape);
    text = metres(m.median) + (m.known ? " " + interval_text(m, metres) : "");
    if (c.scored() < kEven * most) text += fmt::format(", of {:.0f}%", 100 * c.scored());
  } else if (!c.finished.empty()) {
    text = "no truth";
  }
  if (!c.failed.empty()) text += fmt::format("{}{} failed", text.empty() ? "" : ", ", c.failed.size());
  if (c.published) text += fmt::format(" (published {:.4f})", *c.published);
  return text;
}

// Published numbers of systems that are none of the suite's variants.
std::string others(const Results& r, size_t sequence) {
  const SuiteSequence& s = r.suite->sequences[sequence];
  const auto row = r.suite->published.ape_m.find(s.published.empty() ? s.name : s.published);
  if (row == r.suite->published.ape_m.end()) return "";
  std::vector<std::string> words;
  for (const auto& [system, value] : row->second) {
    const bool ours =
        std::any_of(r.suite->variants.begin(), r.suite->variants.end(),
                    [&, name = system](const auto& v) { return (v.published.empty() ? v.name : v.published) == name; });
    if (!ours) words.push_back(fmt::format("{} {:.4f}", system, value));
  }
  return words.empty() ? "" : joined(words);
}

Section overview(const Results& r) {
  Section section{"APE by sequence and variant", {}, {}, {"ape.svg"}};
  section.paragraphs.push_back(
      "Translation error after SE(3) alignment, RMSE in metres: median over the runs and, in brackets, the 95% "
      "bootstrap interval of that median (with five runs it reaches from the smallest to the largest). \"of 20%\": so "
      "many of the frames are scored, fewer than 95% of those of another variant; such errors do not compare.");
  TextTable table;
  table.header = {"sequence"};
  for (size_t v = 0; v < r.suite->variants.size(); ++v)
    if (r.shows(v)) table.header.push_back(r.suite->variants[v].name);
  const bool published = !r.suite->published.ape_m.empty();
  if (published) table.header.push_back("published for other systems");
  for (size_t s = 0; s < r.suite->sequences.size(); ++s) {
    if (!any_run(r, s)) continue;
    std::vector<std::string> row = {r.suite->sequences[s].name};
    for (const Cell& c : r.cells)
      if (c.sequence == s && r.shows(c.variant)) row.push_back(ape_cell(c, most_scored(r, s)));
    if (published) row.push_back(others(r, s));
    table.rows.push_back(row);
  }
  section.tables.push_back(table);
  if (published && !r.suite->published.source.empty())
    section.paragraphs.push_back("Published numbers: " + r.suite->published.source + ".");
  return section;
}

Section comparison(const Results& r) {
  Section section{"Against " + r.suite->reference, {}, {}, {}};
  section.paragraphs.push_back(
      "Geometric mean over the sequences of the ratio of median APEs, below 1 = better than " + r.suite->reference +
      ", with its 95% bootstrap interval (runs of the same seed are drawn together). A sequence counts as better or "
      "worse when the interval of its own ratio leaves out 1. Runs left out failed, or the reference's did: look at "
      "their rows before believing a ratio. *: on one of its sequences, named with the scored shares of both, one of "
      "the two scored fewer than 95% of the frames of the other, most often the easy ones; such a ratio tells little.");
  TextTable table;
  table.header = {"variant",      "sequences", "runs left out", "ratio of APEs",
                  "95% interval", "better on", "worse on",      "unevenly scored"};
  for (const Comparison& c : r.comparisons) {
    const auto variant = std::find_if(r.suite->variants.begin(), r.suite->variants.end(),
                                      [&](const SuiteVariant& v) { return v.name == c.variant; });
    if (!r.shows(static_cast<size_t>(variant - r.suite->variants.begin()))) continue;
    const auto ratio = [](double x) { return fmt::format("{:.3f}", x); };
    const auto marked = [&](std::vector<std::string> sequences) {
      for (std::string& s : sequences) s += c.is_uneven(s) ? "*" : "";
      return joined(sequences);
    };
    std::vector<std::string> uneven;
    for (const Comparison::Uneven& u : c.uneven)
      uneven.push_back(fmt::format("{} ({:.0f}%, {:.0f}%)", u.sequence, 100 * u.ours, 100 * u.reference));
    table.rows.push_back({c.variant, std::to_string(c.sequences), std::to_string(c.left_out),
                          c.sequences > 0 ? ratio(c.ratio.median) + (uneven.empty() ? "" : "*") : kNone,
                          c.ratio.known ? interval_text(c.ratio, ratio) : kNone, marked(c.better), marked(c.worse),
                          joined(uneven)});
  }
  section.tables.push_back(table);
  return section;
}

Section details(const Results& r) {
  Section section{"Accuracy, tracking and map", {}, {}, {}};
  section.paragraphs.push_back(
      "Median over the runs that finished; worst is the largest APE, and the smallest tracked share. Online: poses as "
      "they were known when each was published. Scored: pairs that the APE is of, of those offered; frames of maps "
      "that were never joined to the first count as tracked alone. Map: points, and the size of map.dkb. Published "
      "numbers are of whole sequences: look at the pairs before comparing.");
  TextTable table;
  table.text_columns = 2;
  table.header = {"sequence", "variant",   "runs",       "pairs",       "APE [m]",      "95% interval",
                  "worst",    "APE [deg]", "online [m]", "tracked [%]", "worst [%]",    "scored [%]",
                  "maps",     "keyframes", "map points", "map [kB]",    "published [m]"};
  for (const Cell& c : r.cells) {
    if (!c.any_run()) continue;
    const std::vector<double> ape = c.ape();
    const MedianInterval m = median_interval(ape);
    const auto of = [&](auto&& get) {
      return c.values([&](const RunRecord& run) { return std::optional<double>(get(run)); });
    };
    const auto rotation = c.figures(&RunRecord::ape, &Scores::rotation_deg, &ErrorStatistics::rmse);
    const auto online = c.values(
        [](const RunRecord& run) { return run.online_m ? std::optional<double>(run.online_m->rmse) : std::nullopt; });
    const auto lost = of([](const RunRecord& run) { return 100 - 100 * run.tracked_share(); });
    table.rows.push_back(
        {sequence_of(r, c).name, variant_of(r, c).name,
         fmt::format("{}{}{}", c.finished.size(), c.failed.empty() ? "" : fmt::format(", {} failed", c.failed.size()),
                     c.not_run == 0 ? "" : fmt::format(", {} not run", c.not_run)),
         number(of([](const RunRecord& run) { return static_cast<double>(run.frames); }), 0),
         ape.empty() ? kNone : metres(m.median), m.known ? interval_text(m, metres) : kNone, metres(worst(ape)),
         number(rotation, 3), online.empty() ? kNone : metres(median_of(online)),
         lost.empty() ? kNone : fmt::format("{:.1f}", 100 - median_of(lost)),
         lost.empty() ? kNone : fmt::format("{:.1f}", 100 - worst(lost)),
         ape.empty() ? kNone : fmt::format("{:.1f}", 100 * c.scored()),
         lost.empty()
             ? kNone
             : fmt::format("{:.0f}", worst(of([](const RunRecord& run) { return static_cast<double>(run.maps); }))),
         number(of([](const RunRecord& run) { return static_cast<double>(run.keyframes); }), 0),
         number(of([](const RunRecord& run) { return static_cast<double>(run.map_points); }), 0),
         number(of([](const RunRecord& run) { return 1e-3 * static_cast<double>(run.map_bytes); }), 0),
         c.published ? fmt::format("{:.4f}", *c.published) : ""});
  }
  section.tables.push_back(table);
  return section;
}

// What papers print of each sequence.
Section errors(const Results& r) {
  Section section{"Errors by sequence", {}, {}, {}};
  section.paragraphs.push_back(
      "Medians over the runs. APE after SE(3) alignment: RMSE, mean, median, standard deviation (S.D.) and largest, "
      "and RMSE of the rotation. RPE over one frame, RMSE. Scored: pairs that these are of, of those offered.");
  for (size_t s = 0; s < r.suite->sequences.size(); ++s) {
    TextTable table;
    table.header = {r.suite->sequences[s].name,
                    "APE RMSE [m]",
                    "mean [m]",
                    "median [m]",
                    "S.D. [m]",
                    "largest [m]",
                    "APE [deg]",
                    "RPE [m/frame]",
                    "RPE [deg/frame]",
                    "scored [%]"};
    for (const Cell& c : r.cells) {
      if (c.sequence != s || c.ape().empty()) continue;
      const auto in_metres = [](const std::vector<double>& values) {
        return values.empty() ? kNone : metres(median_of(values));
      };
      std::vector<std::string> row = {variant_of(r, c).name};
      for (const auto of : {&ErrorStatistics::rmse, &ErrorStatistics::mean, &ErrorStatistics::median,
                            &ErrorStatistics::std, &ErrorStatistics::max})
        row.push_back(in_metres(c.figures(&RunRecord::ape, &Scores::translation_m, of)));
      row.push_back(number(c.figures(&RunRecord::ape, &Scores::rotation_deg, &ErrorStatistics::rmse), 3));
      row.push_back(in_metres(c.figures(&RunRecord::rpe, &Scores::translation_m, &ErrorStatistics::rmse)));
      row.push_back(number(c.figures(&RunRecord::rpe, &Scores::rotation_deg, &ErrorStatistics::rmse), 3));
      row.push_back(fmt::format("{:.1f}", 100 * c.scored()));
      table.rows.push_back(row);
    }
    if (!table.rows.empty()) section.tables.push_back(table);
  }
  return section;
}

Section failures(const Results& r) {
  Section section{"Runs that failed, and what was not run", {}, {}, {}};
  TextTable failed;
  failed.text_columns = 4;
  failed.header = {"sequence", "variant", "seed", "what happened"};
  for (const Cell& c : r.cells)
    for (const RunRecord& run : c.failed)
      failed.rows.push_back({run.sequence, run.variant, std::to_string(run.seed), run.failure});
  if (!failed.rows.empty()) section.tables.push_back(failed);
  TextTable missing;
  missing.text_columns = 3;
  missing.header = {"what", "runs missing", "how to get it"};
  const auto& chosen = r.chosen_sequences;
  for (size_t s = 0; s < r.suite->sequences.size(); ++s)
    if (!any_run(r, s) &&
        (chosen.empty() || std::find(chosen.begin(), chosen.end(), r.suite->sequences[s].name) != chosen.end()))
      missing.rows.push_back({"sequence " + r.suite->sequences[s].name, "all", r.suite->sequences[s].get});
  for (size_t v = 0; v < r.suite->variants.size(); ++v)
    if (r.shows(v) &&
        std::none_of(r.cells.begin(), r.cells.end(), [&](const Cell& c) { return c.variant == v && c.any_run(); }))
      missing.rows.push_back({"variant " + r.suite->variants[v].name, "all", r.suite->variants[v].get});
  if (!missing.rows.empty()) section.tables.push_back(missing);
  if (section.tables.empty()) section.paragraphs.push_back("None.");
  return section;
}

Section sensitivity(const Results& r) {
  const SuiteSweep& sweep = *r.suite->sweep;
  Section section{"Sensitivity to " + sweep.label + " (" + sweep.setting + ")", sweep_sentences(r), {}, {"sweep.svg"}};
  TextTable table;
  table.header = {"sequence"};
  for (const SuiteVariant& v : r.suite->variants)
    if (v.swept) table.header.push_back(v.name);
  for (const SweepResult& s : r.sweep) {
    std::vector<std::string> row = {s.sequence + " [m]"}, published = {"(published)"};
    for (const MedianInterval& m : s.ape)
      row.push_back(metres(m.median) + (m.known ? " " + interval_text(m, metres) : ""));
    bool any = false;
    for (const SuiteVariant& v : r.suite->variants)
      if (v.swept) {
        const auto value = r.suite->published_ape(*r.suite->sequence(s.sequence), v);
        any = any || value.has_value();
        published.push_back(value ? fmt::format("{:.4f}", *value) : "");
      }
    table.rows.push_back(row);
    if (any) table.rows.push_back(published);
  }
  section.tables.push_back(table);
  return section;
}

Section times(const Results& r) {
  Section section{"Times and memory", {}, {}, {}};
  std::set<std::string> programs;
  std::set<std::pair<int, int>> loads;
  for (const Cell& c : r.cells)
    for (const RunRecord& run : c.finished)
      programs.insert(run.machine.program), loads.insert({run.machine.parallel_runs, run.machine.cores});
  std::vector<std::string> load;
  for (const auto& [parallel, cores] : loads) load.push_back(fmt::format("{} at a time on {} cores", parallel, cores));
  section.paragraphs.push_back(
      "Times in cv_orb: the mean time per frame of OpenCV's ORB with 1000 features on one thread, measured on the same "
      "images in the process of each run, right after it; n/a where OpenCV is missing. A run keeps two threads busy; "
      "these ran " +
      joined(load) + ", so times of runs side by side, or on a busy machine, are rough. Medians over the runs.");
  section.paragraphs.push_back("Program: dkb-slam " + joined({programs.begin(), programs.end()}) + ".");
  TextTable table;
  table.text_columns = 2;
  table.header = {"sequence",       "variant",      "cv_orb [ms]",       "tracking",
                  "tracking worst", "tracking p95", "local BA/keyframe", "keyframe decision",
                  "tracking [ms]",  "run [s]",      "CPU [s]",           "memory [MB]"};
  for (const Cell& c : r.cells) {
    if (c.finished.empty()) continue;
    const auto in_orb = [&](double MachineFacts::*field) {
      return c.values([&](const RunRecord& run) {
        return run.machine.cv_orb_ms ? std::optional<double>(run.machine.*field / *run.machine.cv_orb_ms)
                                     : std::nullopt;
      });
    };
    const auto plain = [&](double MachineFacts::*field) {
      return c.values([&](const RunRecord& run) { return std::optional<double>(run.machine.*field); });
    };
    const auto unit = c.values([](const RunRecord& run) { return run.machine.cv_orb_ms; });
    const auto tracking = in_orb(&MachineFacts::tracking_ms);
    table.rows.push_back({sequence_of(r, c).name, variant_of(r, c).name, number(unit, 2), number(tracking, 2),
                          tracking.empty() ? kNone : fmt::format("{:.2f}", worst(tracking)),
                          number(in_orb(&MachineFacts::tracking_p95_ms), 2),
                          number(in_orb(&MachineFacts::local_ba_ms), 2),
                          number(in_orb(&MachineFacts::keyframe_decision_ms), 3),
                          number(plain(&MachineFacts::tracking_ms), 2), number(plain(&MachineFacts::wall_s), 1),
                          number(plain(&MachineFacts::cpu_s), 1), number(plain(&MachineFacts::peak_mb), 0)});
  }
  section.tables.push_back(table);
  return section;
}

std::string markdown(const std::string& title, const std::vector<std::string>& head,
                     const std::vector<Section>& sections, const std::map<std::string, std::string>& plots) {
  std::string out = "# " + title + "\n";
  for (const std::string& p : head) out += "\n" + p + "\n";
  for (const Section& s : sections) {
    out += "\n## " + s.title + "\n";
    for (const std::string& p : s.paragraphs) out += "\n" + p + "\n";
    for (const TextTable& t : s.tables) out += "\n" + markdown_table(t);
    for (const std::string& name : s.plots)
      if (plots.contains(name)) out += fmt::format("\n![{0}](plots/{0})\n", name);
  }
  return out;
}

std::string html(const std::string& title, const std::vector<std::string>& head, const std::vector<Section>& sections,
                 const std::map<std::string, std::string>& plots) {
  std::string out =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" "
      "content=\"width=device-width\">\n<title>" +
      svg::escaped(title) +
      "</title>\n<style>\nbody{font:15px/1.5 Helvetica,Arial,sans-serif;color:#24292f;max-width:1280px;margin:2em "
      "auto;padding:0 1em}\ntable{border-collapse:collapse;margin:1em "
      "0;display:block;overflow-x:auto;font-size:13px}\nth,td{border:1px "
      "solid #d0d7de;padding:4px "
      "7px;text-align:left;white-space:nowrap}\nth{background:#f6f8fa;white-space:normal;vertical-align:bottom}\n.n{"
      "text-align:right}\n"
      "svg{max-width:100%;height:auto}\n</style>\n</head>\n<body>\n<h1>" +
      svg::escaped(title) + "</h1>\n";
  for (const std::string& p : head) out += "<p>" + svg::escaped(p) + "</p>\n";
  for (const Section& s : sections) {
    out += "<h2>" + svg::escaped(s.title) + "</h2>\n";
    for (const std::string& p : s.paragraphs) out += "<p>" + svg::escaped(p) + "</p>\n";
    for (const TextTable& t : s.tables) out += html_table(t);
    for (const std::string& name : s.plots)
      if (plots.contains(name)) out += plots.at(name);
  }
  return out + "</body>\n</html>\n";
}

std::string chosen_of(const std::vector<std::string>& chosen, size_t all) {
  return chosen.empty() ? std::to_string(all) : fmt::format("{} of {}", chosen.size(), all);
}

}  // namespace

Report make_report(const ResultsFolder& folder, const ReportOptions& options) {
  const Suite& suite = folder.suite();
  std::vector<RunRecord> records;
  for (const Job& job : jobs_of(suite))
    if (auto record = folder.record(job)) records.push_back(std::move(*record));
  Results results = results_of(suite, records);
  results.chosen_sequences = folder.text().sequences;
  results.chosen_variants = folder.text().variants;

  Report report;
  report.plots = make_plots(folder, results);
  std::vector<Section> sections = {overview(results)};
  if (!results.comparisons.empty()) sections.push_back(comparison(results));
  if (suite.sweep) sections.push_back(sensitivity(results));
  sections.push_back(details(results));
  if (Section scores = errors(results); !scores.tables.empty()) sections.push_back(std::move(scores));
  sections.push_back(failures(results));
  if (options.times) sections.push_back(times(results));
  Section figures{
      "Plots",
      {"Bars as in figures 7 and 8 of the DKB paper, medians over the runs; paths as in its figures 5 and 6, "
       "of the run with the median APE."},
      {},
      {}};
  for (const auto& [name, unused] : report.plots)
    if (name != "ape.svg" && name != "sweep.svg") figures.plots.push_back(name);
  if (!figures.plots.empty()) sections.push_back(figures);

  const std::string title = "Bench: " + suite.name;
  std::vector<std::string> head;
  if (!suite.description.empty()) head.push_back(suite.description);
  head.push_back(
      fmt::format("Suite {} ({}): {} sequences x {} variants x {} runs. Run s has seed s and leaves out the "
                  "first s - 1 pairs, so that runs differ in earnest.{}",
                  suite.name, suite_hash(suite), chosen_of(results.chosen_sequences, suite.sequences.size()),
                  chosen_of(results.chosen_variants, suite.variants.size()), suite.seeds,
                  suite.max_frames > 0 ? fmt::format(" At most {} pairs each.", suite.max_frames) : ""));
  report.markdown = markdown(title, head, sections, report.plots);
  report.html = html(title, head, sections, report.plots);
  report.json = results_json(results, options);
  return report;
}

void write_report(const std::filesystem::path& folder, const Report& report) {
  make_output_folder(folder / "plots");
  for (const auto& [name, svg] : report.plots) write_file_atomically(folder / "plots" / name, svg);
  write_file_atomically(folder / "results.json", report.json);
  write_file_atomically(folder / "report.html", report.html);
  write_file_atomically(folder / "results.md", report.markdown);
}

}  // namespace dkb::bench

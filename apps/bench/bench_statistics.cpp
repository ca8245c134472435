// SPDX-License-Identifier: Apache-2.0
// The report's numbers; bench_report.cpp puts them into words.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "bench/bench_report.h"

namespace dkb::bench {
namespace {

constexpr uint64_t kSeed = 1;  // of resampling: reports are functions of the records

std::optional<double> ape_of(const RunRecord& r) {
  return r.ape ? std::optional<double>(r.ape->translation_m.rmse) : std::nullopt;
}

// The APEs of the seeds that both have.
PairedRuns paired(const Cell& ours, const Cell& reference) {
  PairedRuns pairs;
  for (const RunRecord& a : ours.finished)
    for (const RunRecord& b : reference.finished)
      if (a.seed == b.seed && a.ape && b.ape && a.ape->translation_m.rmse > 0 && b.ape->translation_m.rmse > 0) {
        pairs.ours.push_back(a.ape->translation_m.rmse);
        pairs.reference.push_back(b.ape->translation_m.rmse);
      }
  return pairs;
}

std::vector<Comparison> compare(const Suite& suite, const std::vector<Cell>& cells) {
  std::vector<Comparison> result;
  if (suite.reference.empty()) return result;
  const size_t n = suite.variants.size();
  size_t reference = 0;
  while (suite.variants[reference].name != suite.reference) ++reference;
  for (size_t v = 0; v < n; ++v) {
    if (v == reference) continue;
    Comparison c;
    c.variant = suite.variants[v].name;
    std::vector<PairedRuns> all;
    for (size_t s = 0; s < suite.sequences.size(); ++s) {
      const Cell &ours = cells[s * n + v], &theirs = cells[s * n + reference];
      PairedRuns pairs = paired(ours, theirs);
      if (!ours.any_run() && !theirs.any_run()) continue;
      c.left_out += suite.seeds - static_cast<int>(pairs.ours.size());
      if (pairs.ours.empty()) continue;
      if (const double a = ours.scored(), b = theirs.scored(); a < kEven * b || b < kEven * a)
        c.uneven.push_back({suite.sequences[s].name, a, b});
      const MedianInterval here = mean_ratio({pairs});
      if (here.known && here.interval.high < 1) c.better.push_back(suite.sequences[s].name);
      if (here.known && here.interval.low > 1) c.worse.push_back(suite.sequences[s].name);
      all.push_back(std::move(pairs));
    }
    c.sequences = static_cast<int>(all.size());
    c.ratio = mean_ratio(all);
    result.push_back(std::move(c));
  }
  return result;
}

std::optional<SweepResult> swept(const Suite& suite, const std::vector<Cell>& cells, size_t s,
                                 const std::vector<size_t>& variants) {
  const size_t n = suite.variants.size();
  SweepResult result;
  result.sequence = suite.sequences[s].name;
  std::vector<std::vector<double>> by_seed, by_value(variants.size());
  for (int seed = 1; seed <= suite.seeds; ++seed) {
    std::vector<double> row;
    for (const size_t v : variants)
      for (const RunRecord& r : cells[s * n + v].finished)
        if (r.seed == seed && r.ape) row.push_back(r.ape->translation_m.rmse);
    if (row.size() != variants.size()) continue;
    for (size_t k = 0; k < row.size(); ++k) by_value[k].push_back(row[k]);
    by_seed.push_back(std::move(row));
  }
  if (by_seed.empty()) return {};
  result.runs = by_seed.size();
  std::vector<double> medians, widths;
  for (const auto& values : by_value) {
    result.ape.push_back(median_interval(values));
    medians.push_back(result.ape.back().median);
    widths.push_back(result.ape.back().interval.high - result.ape.back().interval.low);
  }
  const auto [low, high] = std::minmax_element(medians.begin(), medians.end());
  result.best = static_cast<size_t>(low - medians.begin());
  result.spread = *high - *low;
  result.noise = result.ape[0].known ? median_of(widths) : std::numeric_limits<double>::quiet_NaN();
  result.p_value = friedman_p_value(by_seed, kSeed);
  for (size_t k = 0; k < variants.size(); ++k)
    if (suite.sweep->published_choice && suite.variants[variants[k]].swept == *suite.sweep->published_choice)
      result.choice = mean_ratio({{by_value[k], by_value[result.best]}});
  return result;
}

std::vector<SweepResult> sweep_results(const Suite& suite, const std::vector<Cell>& cells) {
  std::vector<SweepResult> results;
  if (!suite.sweep) return results;
  std::vector<size_t> variants;
  for (size_t v = 0; v < suite.variants.size(); ++v)
    if (suite.variants[v].swept) variants.push_back(v);
  for (size_t s = 0; s < suite.sequences.size(); ++s)
    if (auto result = swept(suite, cells, s, variants)) results.push_back(std::move(*result));
  for (SweepResult& r : results) r.exceeds_noise = r.p_value < 0.05 / static_cast<double>(results.size());
  return results;
}

}  // namespace

std::vector<double> Cell::figures(std::optional<Scores> RunRecord::*kind, ErrorStatistics Scores::*part,
                                  double ErrorStatistics::*figure) const {
  return values([&](const RunRecord& run) {
    const std::optional<Scores>& scores = run.*kind;
    const bool known = scores && ((*scores).*part).count > 0;
    return known ? std::optional<double>((*scores).*part.*figure) : std::nullopt;
  });
}

std::vector<double> Cell::ape() const {
  return values(ape_of);
}

double Cell::scored() const {
  const std::vector<double> shares =
      values([](const RunRecord& r) { return r.ape ? std::optional<double>(r.scored_share()) : std::nullopt; });
  return shares.empty() ? 0 : median_of(shares);
}

bool Results::shows(size_t variant) const {
  const auto& chosen = chosen_variants;
  return chosen.empty() || std::find(chosen.begin(), chosen.end(), suite->variants[variant].name) != chosen.end() ||
         std::any_of(cells.begin(), cells.end(), [&](const Cell& c) { return c.variant == variant && c.any_run(); });
}

bool Comparison::is_uneven(const std::string& sequence) const {
  return std::any_of(uneven.begin(), uneven.end(), [&](const Uneven& u) { return u.sequence == sequence; });
}

Results results_of(const Suite& suite, const std::vector<RunRecord>& records) {
  Results results;
  results.suite = &suite;
  for (size_t s = 0; s < suite.sequences.size(); ++s)
    for (size_t v = 0; v < suite.variants.size(); ++v) {
      Cell cell;
      cell.sequence = s;
      cell.variant = v;
      cell.published = suite.published_ape(suite.sequences[s], suite.variants[v]);
      for (const RunRecord& r : records)
        if (r.sequence == suite.sequences[s].name && r.variant == suite.variants[v].name)
          (r.ok() ? cell.finished : cell.failed).push_back(r);
      const auto by_seed = [](const RunRecord& a, const RunRecord& b) { return a.seed < b.seed; };
      std::sort(cell.finished.begin(), cell.finished.end(), by_seed);
      std::sort(cell.failed.begin(), cell.failed.end(), by_seed);
      cell.not_run = suite.seeds - static_cast<int>(cell.finished.size() + cell.failed.size());
      results.cells.push_back(std::move(cell));
    }
  results.comparisons = compare(suite, results.cells);
  results.sweep = sweep_results(suite, results.cells);
  return results;
}

std::vector<std::string> sweep_sentences(const Results& results) {
  std::vector<std::string> sentences;
  if (!results.suite->sweep || results.sweep.empty()) return sentences;
  const SuiteSweep& sweep = *results.suite->sweep;
  size_t exceed = 0;
  for (const SweepResult& r : results.sweep) {
    exceed += r.exceeds_noise;
    if (r.p_value == 1 && r.spread == 0) {
      sentences.push_back(
          fmt::format("{}: every value gives the same medians over {} runs: there is nothing to choose "
                      "by here.",
                      r.sequence, r.runs));
      continue;
    }
    std::string text = fmt::format(
        "{}: the medians over {} runs lie {:.2f} mm apart ({:.1f}% of the smallest), while their own 95% intervals "
        "are ",
        r.sequence, r.runs, 1000 * r.spread, 100 * r.spread / r.ape[r.best].median);
    text += std::isfinite(r.noise) ? fmt::format("{:.2f} mm wide", 1000 * r.noise)
                                   : std::string("unknown with so few runs");
    text += fmt::format("; smallest at {} = {:g}; Friedman's test over the runs: p = {:.3f}: ", sweep.label,
                        sweep.values[r.best], r.p_value);
    text += r.exceeds_noise ? "the differences exceed the noise." : "the differences do not exceed the noise.";
    if (r.choice && r.choice->known && sweep.values[r.best] != *sweep.published_choice)
      text += fmt::format(
          " {} = {:g} has {:.3f} [{:.3f}, {:.3f}] times the APE of the smallest, which was picked after "
          "the fact.",
          sweep.label, *sweep.published_choice, r.choice->median, r.choice->interval.low, r.choice->interval.high);
    sentences.push_back(text);
  }
  const size_t n = results.sweep.size();
  const char* verdict = exceed == 0   ? "On no sequence do the differences exceed the noise: the data do not tell one "
                                        "value from another"
                        : exceed == n ? "The differences exceed the noise on every sequence"
                                      : "The differences exceed the noise on some sequences only";
  sentences.insert(sentences.begin(),
                   fmt::format("{} ({} of {} sequences; significance 5% divided by {}).", verdict, exceed, n, n));
  return sentences;
}

}  // namespace dkb::bench

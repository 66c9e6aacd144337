#include "server/api/job_filter.h"

#include <google/protobuf/util/time_util.h>

#include <optional>
#include <string>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "litags/v1/job.pb.h"
#include "server/api/convert.h"
#include "server/jobs/codec.h"

namespace litags {
namespace {

constexpr size_t kMaxFilterBytes = 1000;
constexpr int kMaxDepth = 20;  // of parentheses and NOT

enum class Relation { kEqual, kNotEqual, kLess, kLessOrEqual, kMore, kMoreOrEqual, kHas };

template <typename T>
bool Holds(const T& a, Relation relation, const T& b) {
  switch (relation) {
    case Relation::kEqual:
      return a == b;
    case Relation::kNotEqual:
      return a != b;
    case Relation::kLess:
      return a < b;
    case Relation::kLessOrEqual:
      return a <= b;
    case Relation::kMore:
      return a > b;
    case Relation::kMoreOrEqual:
      return a >= b;
    case Relation::kHas:
      return false;
  }
  return false;
}

// A "*" at either end of the pattern stands for any text.
bool Matches(std::string_view text, std::string_view pattern) {
  const bool open_end = pattern.ends_with('*');
  if (open_end) pattern.remove_suffix(1);
  const bool open_start = pattern.starts_with('*');
  if (open_start) pattern.remove_prefix(1);
  if (open_start && open_end) return text.find(pattern) != std::string_view::npos;
  if (open_start) return text.ends_with(pattern);
  if (open_end) return text.starts_with(pattern);
  return text == pattern;
}

// Recursive descent over
//   expression = factor {"AND" factor};  factor = term {"OR" term}
//   term = ["NOT" | "-"] ("(" expression ")" | field relation value)
class Parser {
 public:
  explicit Parser(std::string_view text) : text_(text) {}

  absl::StatusOr<JobFilter> Parse() {
    LITAGS_ASSIGN_OR_RETURN(JobFilter filter, Expression(0));
    Skip();
    if (at_ < text_.size()) return Bad("AND, OR or the end");
    return filter;
  }

 private:
  using Text = std::string (*)(const JobRecord&);

  absl::Status Bad(std::string_view wanted) const {
    return InvalidInput(
        "FILTER_INVALID", "filter",
        absl::StrCat("filter: at character ", at_ + 1, " there should be ", std::string(wanted),
                     "; example: state = FAILED AND labels.site = \"north\""));
  }

  void Skip() {
    while (at_ < text_.size() && absl::ascii_isspace(text_[at_])) ++at_;
  }

  bool Take(std::string_view token) {
    Skip();
    if (!text_.substr(at_).starts_with(token)) return false;
    at_ += token.size();
    return true;
  }

  // A keyword is no prefix of a longer word.
  bool TakeWord(std::string_view word) {
    Skip();
    const size_t end = at_ + word.size();
    if (!text_.substr(at_).starts_with(word)) return false;
    if (end < text_.size() && IsWordByte(text_[end])) return false;
    at_ = end;
    return true;
  }

  static bool IsWordByte(char c) {
    return absl::ascii_isalnum(c) || c == '_' || c == '-' || c == '.' || c == '/' || c == '*' ||
           static_cast<unsigned char>(c) >= 0x80;
  }

  // A text in quotes, in which a backslash takes the next byte as it is, or a bare word.
  absl::StatusOr<std::string> Value() {
    Skip();
    std::string value;
    if (!Take("\"")) {
      while (at_ < text_.size() && IsWordByte(text_[at_])) value += text_[at_++];
      if (value.empty()) return Bad("a value");
      return value;
    }
    for (; at_ < text_.size(); ++at_) {
      if (text_[at_] == '"') {
        ++at_;
        return value;
      }
      if (text_[at_] == '\\' && at_ + 1 < text_.size()) ++at_;
      value += text_[at_];
    }
    return Bad("a \" that ends the text");
  }

  std::optional<Relation> TakeRelation() {
    if (Take("!=")) return Relation::kNotEqual;
    if (Take("<=")) return Relation::kLessOrEqual;
    if (Take(">=")) return Relation::kMoreOrEqual;
    if (Take("=")) return Relation::kEqual;
    if (Take("<")) return Relation::kLess;
    if (Take(">")) return Relation::kMore;
    if (Take(":")) return Relation::kHas;
    return std::nullopt;
  }

  absl::StatusOr<JobFilter> Expression(int depth) {
    LITAGS_ASSIGN_OR_RETURN(JobFilter all, Factor(depth));
    while (TakeWord("AND")) {
      LITAGS_ASSIGN_OR_RETURN(JobFilter next, Factor(depth));
      all = [a = std::move(all), b = std::move(next)](const JobRecord& job) {
        return a(job) && b(job);
      };
    }
    return all;
  }

  absl::StatusOr<JobFilter> Factor(int depth) {
    LITAGS_ASSIGN_OR_RETURN(JobFilter any, Term(depth));
    while (TakeWord("OR")) {
      LITAGS_ASSIGN_OR_RETURN(JobFilter next, Term(depth));
      any = [a = std::move(any), b = std::move(next)](const JobRecord& job) {
        return a(job) || b(job);
      };
    }
    return any;
  }

  absl::StatusOr<JobFilter> Term(int depth) {
    if (depth > kMaxDepth) return Bad("fewer parentheses around it");
    if (TakeWord("NOT") || Take("-")) {
      LITAGS_ASSIGN_OR_RETURN(JobFilter term, Term(depth + 1));
      return JobFilter([term = std::move(term)](const JobRecord& job) { return !term(job); });
    }
    if (Take("(")) {
      LITAGS_ASSIGN_OR_RETURN(JobFilter inside, Expression(depth + 1));
      if (!Take(")")) return Bad("a )");
      return inside;
    }
    return Comparison();
  }

  absl::StatusOr<JobFilter> Comparison() {
    Skip();
    const size_t start = at_;
    while (at_ < text_.size() && IsWordByte(text_[at_])) ++at_;
    const std::string field(text_.substr(start, at_ - start));
    const auto relation = TakeRelation();
    if (field.empty() || !relation) {
      at_ = start;
      return Bad("a field, a relation and a value");
    }
    const size_t value_at = at_;
    LITAGS_ASSIGN_OR_RETURN(const std::string value, Value());
    auto filter = Compare(field, *relation, value);
    if (filter.ok()) return filter;
    // The place of what is wrong: the field's name, or what it is compared with.
    const bool field_is_wrong = absl::IsNotFound(filter.status());
    at_ = field_is_wrong ? start : value_at;
    return Bad(std::string(filter.status().message()));
  }

  // NOT_FOUND: the field; INVALID_ARGUMENT: the relation or the value. The message says what there
  // should be.
  static absl::StatusOr<JobFilter> Compare(const std::string& field, Relation relation,
                                           const std::string& value) {
    if (field == "state") return CompareState(relation, value);
    if (field == "name") {
      return CompareText([](const JobRecord& job) { return JobName(job.id); }, relation, value);
    }
    if (field == "owner") {
      return CompareText([](const JobRecord& job) { return job.owner; }, relation, value);
    }
    if (field == "display_name") {
      return CompareText([](const JobRecord& job) { return job.display_name; }, relation, value);
    }
    if (field == "policy.priority") return ComparePriority(relation, value);
    if (field == "create_time") return CompareTime(&JobRecord::create_time_ms, relation, value);
    if (field == "start_time") return CompareTime(&JobRecord::start_time_ms, relation, value);
    if (field == "end_time") return CompareTime(&JobRecord::end_time_ms, relation, value);
    if (field == "labels" && relation == Relation::kHas) return HasLabel(value);
    constexpr std::string_view kLabel = "labels.";
    if (field.starts_with(kLabel) && field.size() > kLabel.size()) {
      return CompareLabel(field.substr(kLabel.size()), relation, value);
    }
    return absl::NotFoundError(
        "one of the fields state, name, display_name, owner, policy.priority, labels.KEY, "
        "create_time, "
        "start_time and end_time");
  }

  static absl::StatusOr<JobFilter> CompareState(Relation relation, const std::string& value) {
    v1::JobState state = v1::JOB_STATE_UNSPECIFIED;
    constexpr std::string_view kPrefix = "JOB_STATE_";
    const std::string full = value.starts_with(kPrefix) ? value : std::string(kPrefix) + value;
    if (!v1::JobState_Parse(full, &state) || state == v1::JOB_STATE_UNSPECIFIED) {
      return absl::InvalidArgumentError("a state, such as QUEUED or FAILED");
    }
    if (relation != Relation::kEqual && relation != Relation::kNotEqual) {
      return absl::InvalidArgumentError("= or != before a state");
    }
    return JobFilter([state = static_cast<JobState>(state), relation](const JobRecord& job) {
      return Holds(job.state, relation, state);
    });
  }

  static absl::StatusOr<JobFilter> CompareText(Text text, Relation relation,
                                               const std::string& value) {
    switch (relation) {
      case Relation::kEqual:
        return JobFilter([=](const JobRecord& job) { return Matches(text(job), value); });
      case Relation::kNotEqual:
        return JobFilter([=](const JobRecord& job) { return !Matches(text(job), value); });
      case Relation::kHas:
        return JobFilter(
            [=](const JobRecord& job) { return text(job).find(value) != std::string::npos; });
      default:
        return absl::InvalidArgumentError("=, != or : before a text");
    }
  }

  static absl::StatusOr<JobFilter> ComparePriority(Relation relation, const std::string& value) {
    int priority = 0;
    if (relation == Relation::kHas || !absl::SimpleAtoi(value, &priority)) {
      return absl::InvalidArgumentError("=, !=, <, <=, > or >= and a whole number");
    }
    return JobFilter([=](const JobRecord& job) { return Holds(job.priority, relation, priority); });
  }

  // A time that has not come yet is in no relation to another, but unequal to it.
  static absl::StatusOr<JobFilter> CompareTime(int64_t JobRecord::*time, Relation relation,
                                               const std::string& value) {
    using google::protobuf::util::TimeUtil;
    google::protobuf::Timestamp parsed;
    if (relation == Relation::kHas || !TimeUtil::FromString(value, &parsed)) {
      return absl::InvalidArgumentError(
          "a time in quotes, such as \"2026-01-31T12:00:00Z\", after =, !=, <, <=, > or >=");
    }
    const int64_t ms = TimeUtil::TimestampToMilliseconds(parsed);
    return JobFilter([=](const JobRecord& job) {
      if (job.*time == 0) return relation == Relation::kNotEqual;
      return Holds(job.*time, relation, ms);
    });
  }

  // Of a label that the job lacks: nullopt, and so of labels that cannot be read.
  static std::optional<std::string> LabelOf(const JobRecord& job, const std::string& key) {
    const auto labels = LabelsOf(job);
    if (!labels.ok()) return std::nullopt;
    const auto found = labels->find(key);
    if (found == labels->end()) return std::nullopt;
    return found->second;
  }

  static JobFilter HasLabel(const std::string& key) {
    return [=](const JobRecord& job) { return LabelOf(job, key).has_value(); };
  }

  static absl::StatusOr<JobFilter> CompareLabel(const std::string& key, Relation relation,
                                                const std::string& value) {
    if (relation == Relation::kEqual || (relation == Relation::kHas && value == "*")) {
      return JobFilter([=](const JobRecord& job) {
        const auto label = LabelOf(job, key);
        return label && Matches(*label, value);
      });
    }
    if (relation == Relation::kNotEqual) {
      return JobFilter([=](const JobRecord& job) {
        const auto label = LabelOf(job, key);
        return !label || !Matches(*label, value);
      });
    }
    return absl::InvalidArgumentError("= or != before a label's value");
  }

  const std::string_view text_;
  size_t at_ = 0;
};

}  // namespace

absl::StatusOr<JobFilter> ParseJobFilter(std::string_view text) {
  if (text.size() > kMaxFilterBytes) {
    return InvalidInput("FILTER_INVALID", "filter",
                        absl::StrCat("filter has ", text.size(), " bytes; at most ",
                                     kMaxFilterBytes, " are allowed"));
  }
  if (absl::StripAsciiWhitespace(absl::string_view(text.data(), text.size())).empty()) {
    return JobFilter([](const JobRecord&) { return true; });
  }
  return Parser(text).Parse();
}

}  // namespace litags

#include "server/worker/log.h"

#include <spdlog/formatter.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <memory>
#include <nlohmann/json.hpp>
#include <string_view>

#include "engine/core/json_text.h"
#include "engine/core/utf8.h"

namespace litags {
namespace {

// 2026-01-31T12:34:56.789Z
std::string TimeText(spdlog::log_clock::time_point time) {
  const int64_t ms =
      std::chrono::duration_cast<std::chrono::milliseconds>(time.time_since_epoch()).count();
  const std::time_t seconds = static_cast<std::time_t>(ms / 1000);
  std::tm utc = {};
  gmtime_r(&seconds, &utc);
  return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:03}Z", utc.tm_year + 1900,
                     utc.tm_mon + 1, utc.tm_mday, utc.tm_hour, utc.tm_min, utc.tm_sec, ms % 1000);
}

std::string_view ViewOf(spdlog::string_view_t text) { return {text.data(), text.size()}; }

std::string_view LevelName(const spdlog::details::log_msg& message) {
  return ViewOf(spdlog::level::to_string_view(message.level));
}

void Append(std::string_view text, spdlog::memory_buf_t& out) {
  out.append(text.data(), text.data() + text.size());
}

class TextFormatter : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& out) override {
    Append(fmt::format("{} {} {}: ", TimeText(message.time), LevelName(message),
                       ViewOf(message.logger_name)),
           out);
    for (std::string_view text = ViewOf(message.payload); !text.empty();) {
      const size_t control = ControlLength(text);
      out.push_back(control > 0 ? ' ' : text.front());
      text.remove_prefix(std::max<size_t>(1, control));
    }
    out.push_back('\n');
  }
  std::unique_ptr<spdlog::formatter> clone() const override {
    return std::make_unique<TextFormatter>();
  }
};

class JsonFormatter : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& out) override {
    const std::string_view text = ViewOf(message.payload);
    nlohmann::json object = {{"time", TimeText(message.time)},
                             {"level", LevelName(message)},
                             {"program", ViewOf(message.logger_name)},
                             {"message", text}};
    AddWords(text, &object);
    // Bytes that are not UTF-8 become U+FFFD instead of an exception.
    Append(JsonText(object), out);
    out.push_back('\n');
  }
  std::unique_ptr<spdlog::formatter> clone() const override {
    return std::make_unique<JsonFormatter>();
  }

 private:
  // The "key=value" words in front; what follows may come from clients and forges no member.
  static void AddWords(std::string_view text, nlohmann::json* object) {
    constexpr std::string_view kKeyLetters = "abcdefghijklmnopqrstuvwxyz_";
    while (!text.empty()) {
      const size_t end = std::min(text.find(' '), text.size());
      const std::string_view word = text.substr(0, end);
      const size_t equals = word.find('=');
      if (equals == 0 || equals == std::string_view::npos ||
          word.substr(0, equals).find_first_not_of(kKeyLetters) != std::string_view::npos) {
        return;
      }
      object->emplace(word.substr(0, equals), word.substr(equals + 1));
      text.remove_prefix(std::min(end + 1, text.size()));
    }
  }
};

}  // namespace

bool SetUpLog(const std::string& level, const std::string& format, const std::string& program) {
  auto logger = spdlog::get(program);
  if (!logger) logger = spdlog::stderr_logger_mt(program);
  spdlog::set_default_logger(logger);
  if (format == "json") {
    logger->set_formatter(std::make_unique<JsonFormatter>());
  } else {
    logger->set_formatter(std::make_unique<TextFormatter>());
  }
  const auto parsed = spdlog::level::from_str(level);
  if (parsed == spdlog::level::off && level != "off") {
    spdlog::error("--log-level {} is none of: trace debug info warn error off", level);
    return false;
  }
  spdlog::set_level(parsed);
  return true;
}

}  // namespace litags

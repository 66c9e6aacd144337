#ifndef LITAGS_CLIENT_REPORT_CHART_H_
#define LITAGS_CLIENT_REPORT_CHART_H_

#include <string>
#include <vector>

#include "client/report/course.h"
#include "client/report/html.h"

namespace litags::report {

// Round numbers from low to high, about `count` of them.
std::vector<double> Ticks(double low, double high, int count);

// A curve as SVG: values upwards, iterations to the right, with the time at each mark below it. Its
// colours are the page's. Empty without a point. `shown`: the share of the values, the lowest ones,
// that its height is for; higher ones are cut off.
Html Chart(const std::string& name, const std::string& unit, const std::vector<CurvePoint>& curve,
           double shown = 1);

}  // namespace litags::report

#endif  // LITAGS_CLIENT_REPORT_CHART_H_

/* text.c: formatting and parsing of numbers in ray and hit files.
 *
 * printf and strtod take about 300 and 100 ns a number, which is more than tracing the ray. The fast
 * paths below do exact integer arithmetic, so they give the same digits, and hand all the rest to the C
 * library. */
#include "text.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

__extension__ typedef unsigned __int128 u128;

static const uint64_t power_of_ten[20] = {1u,
                                          10u,
                                          100u,
                                          1000u,
                                          10000u,
                                          100000u,
                                          1000000u,
                                          10000000u,
                                          100000000u,
                                          1000000000u,
                                          10000000000u,
                                          100000000000u,
                                          1000000000000u,
                                          10000000000000u,
                                          100000000000000u,
                                          1000000000000000u,
                                          10000000000000000u,
                                          100000000000000000u,
                                          1000000000000000000u,
                                          10000000000000000000u};

static const uint64_t power_of_five[28] = {1u,
                                           5u,
                                           25u,
                                           125u,
                                           625u,
                                           3125u,
                                           15625u,
                                           78125u,
                                           390625u,
                                           1953125u,
                                           9765625u,
                                           48828125u,
                                           244140625u,
                                           1220703125u,
                                           6103515625u,
                                           30517578125u,
                                           152587890625u,
                                           762939453125u,
                                           3814697265625u,
                                           19073486328125u,
                                           95367431640625u,
                                           476837158203125u,
                                           2384185791015625u,
                                           11920928955078125u,
                                           59604644775390625u,
                                           298023223876953125u,
                                           1490116119384765625u,
                                           7450580596923828125u};

/* A quotient and where its remainder lies: below (-1), at (0) or above (1) one half. */
typedef struct quotient {
    uint64_t whole;
    int half;
} quotient;

static int compare_half(u128 rest, u128 half)
{
    return rest < half ? -1 : rest > half;
}

/* mantissa * 2^exponent * 10^power for power in [-6, 27] and a result under 2^40, exactly. */
static quotient scale(uint64_t mantissa, int exponent, int power)
{
    quotient result = {0, -1};
    if (power >= 0) {
        u128 product = (u128)mantissa * power_of_five[power]; /* under 2^53 * 2^63 */
        int shift = -(exponent + power);
        if (shift <= 0) {
            result.whole = (uint64_t)(product << -shift);
        } else {
            u128 half = (u128)1 << (shift - 1);
            result.whole = (uint64_t)(product >> shift);
            result.half = compare_half(product & ((half << 1) - 1), half);
        }
        return result;
    }
    /* 2 * value / 10^-power, so that the half is a whole number; 10^6 * 2^52 at most below the line. */
    u128 above = mantissa, below = power_of_ten[-power];
    if (exponent >= 0)
        above <<= exponent;
    else
        below <<= -exponent;
    result.whole = (uint64_t)(above / below);
    result.half = compare_half(2 * (above % below), below);
    return result;
}

char *text_format_unsigned(char *out, unsigned long long value)
{
    char digits[24];
    int count = 0;
    do {
        digits[count++] = (char)('0' + value % 10);
        value /= 10;
    } while (value);
    while (count > 0) *out++ = digits[--count];
    return out;
}

/* Nine digits with the point after digits[0], times ten to `power`, written as %g does. */
static char *write_digits(char *out, char digits[9], int power)
{
    int count = 9;
    while (count > 1 && digits[count - 1] == '0') count--;
    if (power < -4 || power >= 9) {
        *out++ = digits[0];
        if (count > 1) *out++ = '.';
        for (int i = 1; i < count; i++) *out++ = digits[i];
        *out++ = 'e';
        *out++ = power < 0 ? '-' : '+';
        int size = power < 0 ? -power : power;
        *out++ = (char)('0' + size / 10);
        *out++ = (char)('0' + size % 10);
        return out;
    }
    if (power < 0) {
        *out++ = '0';
        *out++ = '.';
        for (int i = -1; i > power; i--) *out++ = '0';
        for (int i = 0; i < count; i++) *out++ = digits[i];
        return out;
    }
    for (int i = 0; i < count || i <= power; i++) {
        if (i == power + 1) *out++ = '.';
        *out++ = digits[i];
    }
    return out;
}

char *text_format_g9(char *out, double value)
{
    double size = fabs(value);
    if (!(size >= 1e-18 && size < 1e15)) {
        if (value == 0 && !signbit(value)) {
            *out = '0';
            return out + 1;
        }
        return out + snprintf(out, TEXT_NUMBER_SIZE, "%.9g", value);
    }
    uint64_t bits;
    memcpy(&bits, &size, sizeof bits);
    uint64_t mantissa = (bits & 0xfffffffffffffu) | 0x10000000000000u;
    int exponent = (int)(bits >> 52) - 1075;
    /* A first guess of floor(log10(size)), one too small at most; 0.30103 is log10(2). */
    int power = (int)floor(((double)exponent + 52) * 0.30102999566398120);
    quotient digits = scale(mantissa, exponent, 8 - power);
    if (digits.whole >= 1000000000u) digits = scale(mantissa, exponent, 8 - ++power);
    uint64_t rounded = digits.whole;
    if (digits.half > 0 || (digits.half == 0 && (rounded & 1))) rounded++;
    if (rounded == 1000000000u) {
        rounded = 100000000u;
        power++;
    }
    char text[9];
    for (int i = 8; i >= 0; i--) {
        text[i] = (char)('0' + rounded % 10);
        rounded /= 10;
    }
    if (value < 0) *out++ = '-';
    return write_digits(out, text, power);
}

/* Decimal notation with at most 19 digits whose value is one rounding away: mantissa and power of ten
 * both exact in double (Clinger 1990). Returns false for all the rest. */
static bool parse_simple(const char *begin, const char *end, double *value)
{
    const char *place = begin;
    bool negative = *place == '-';
    if (*place == '-' || *place == '+') place++;
    uint64_t mantissa = 0;
    int digits = 0, power = 0;
    bool point = false;
    for (; place < end; place++) {
        unsigned digit = (unsigned)(unsigned char)*place - '0';
        if (digit < 10) {
            if (++digits > 19) return false;
            mantissa = mantissa * 10 + digit;
            power -= point;
        } else if (*place == '.' && !point) {
            point = true;
        } else {
            break;
        }
    }
    if (digits == 0) return false;
    if (place < end && (*place | 0x20) == 'e' && end - place >= 2) {
        place++;
        bool down = *place == '-';
        if (*place == '-' || *place == '+') place++;
        int written = 0, count = 0;
        for (; place < end && *place >= '0' && *place <= '9' && count < 4; place++, count++)
            written = written * 10 + (*place - '0');
        if (count == 0) return false;
        power += down ? -written : written;
    }
    if (place != end || mantissa > (uint64_t)1 << 53 || power < -19 || power > 19) return false;
    double result = (double)mantissa;
    if (power < 0)
        result /= (double)power_of_ten[-power];
    else
        result *= (double)power_of_ten[power];
    *value = negative ? -result : result;
    return true;
}

bool text_parse_number(const char *begin, const char *end, double *value)
{
    while (begin < end && (*begin == ' ' || *begin == '\t')) begin++;
    while (end > begin && (end[-1] == ' ' || end[-1] == '\t')) end--;
    if (begin == end) return false;
    if (parse_simple(begin, end, value)) return true;
    /* strtod would also skip line ends and read hexadecimal, which are no part of the format. */
    for (const char *place = begin; place < end; place++)
        if (*place == 'x' || *place == 'X' || *place == '(' || (unsigned char)*place <= ' ') return false;
    char *stop = NULL;
    *value = strtod(begin, &stop);
    return stop == end;
}
